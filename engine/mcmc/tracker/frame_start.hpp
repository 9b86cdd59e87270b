// Initial state of the chain in a new frame: the exact assignment of its detections to predicted
// tracks, or the tracks of labels given by the caller and no others. Also finds the ambiguous links.
//
// The tracks are predicted and updated in blocks, on several threads. The results of the blocks are
// merged in order, so they do not depend on the number of threads. The filter of the whole partition
// caches nothing, so the threads share it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/parallel.hpp"
#include "base/scratch.hpp"
#include "mcmc/chain/ambiguous_links.hpp"
#include "mcmc/chain/chain_stats.hpp"
#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"
#include "solve/assignment.hpp"

namespace asterism {

template <typename Filter>
class FrameStart {
 public:
  // A link is ambiguous if its log likelihood is within `ambiguous_within` nats of an alternative.
  FrameStart(bool has_assignment, double ambiguous_within, std::int32_t n_threads)
      : has_assignment_(has_assignment), within_(ambiguous_within), n_threads_(n_threads) {}

  // Forgets the labels given to the frames so far, as others are given to those to come.
  void forget_given() { before_.clear(); }

  // Adds the detections of the newest frame to the tracks of the partition, and its ambiguous
  // links.
  void begin(Partition<Filter>& p, AmbiguousLinks& ambiguous, ChainStats& stats,
             std::int64_t& n_candidates) {
    ambiguous.add_frame();
    list_ends(p);
    give_links(p, stats);
    list_candidates(p);
    n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    const auto n_rows = static_cast<std::int32_t>(s_.rows.size());
    const auto n_columns = static_cast<std::int32_t>(s_.row_given.size());
    s_.match.assign(n_rows, -1);
    if (has_assignment_ && !is_given(p)) s_.assignment.solve_groups(s_.candidates, n_columns, s_.match);
    for (std::int32_t j = 0; j < n_columns; ++j)
      if (s_.row_given[j] >= 0) s_.match[s_.row_given[j]] = j;
    const auto& ids = p.window().frame(p.window().now()).ids;
    for (const auto* list : {&s_.candidates, &s_.others})
      for (const Candidate& c : *list)
        if (s_.match[c.row] != c.column || c.gain < within_)
          ambiguous.add(p.last(s_.rows[c.row]), ids[c.column]);
    for (std::int32_t r = 0; r < n_rows; ++r) {
      const std::int32_t j = s_.match[r];
      if (j < 0 || s_.is_continued[r]) continue;
      Edit<Filter>& edit = next_edit();
      edit.track = s_.rows[r];
      edit.keep = p.track(edit.track).size();
      s_.added.push_back(ids[j]);
    }
    const std::size_t n_begun = s_.n_edits - s_.added.size();
    in_blocks(s_.added.size(), [&](typename Filter::Expected& expected, std::size_t, std::size_t n) {
      append(p, s_.edits[n_begun + n], s_.added[n], expected);
    });
    s_.missed.clear();
    for (std::int32_t r = 0; r < n_rows; ++r)
      if (s_.match[r] < 0) s_.missed.push_back(p.last(s_.rows[r]));
    p.apply(std::span(s_.edits).first(s_.n_edits));  // invalidates the numbers of tracks
    add_ambiguous_births(p, ambiguous);
    for (const std::int32_t last : s_.missed) add_ambiguous_before_last(p, last, ambiguous);
  }

 private:
  static constexpr std::int32_t kNone = -1, kNewTrack = -2;
  static constexpr std::size_t kBlock = 128;  // tracks; fewer take less time than a thread's start
  struct Given {
    std::int32_t detection = -1;
    std::int64_t number = -1;
  };

  // Lists the tracks that a detection of the frame may continue.
  void list_ends(const Partition<Filter>& p) {
    const DetectionWindow& window = p.window();
    s_.rows.clear();
    for (const std::int32_t k : p.tracks().items()) {
      const std::int64_t gap = window.now() - window[p.last(k)].frame;
      if (gap < 1 || gap > window.max_gap()) continue;
      if (static_cast<std::int32_t>(s_.row_of.size()) <= k) s_.row_of.resize(k + 1);
      s_.row_of[k] = static_cast<std::int32_t>(s_.rows.size());
      s_.rows.push_back(k);
    }
  }

  // The row of the track whose last detection is i, kNone if there is none.
  std::int32_t row_ending_at(const Partition<Filter>& p, std::int32_t i) const {
    const std::int32_t k = p.track_of(i);
    const bool is_listed =
        k >= 0 && p.last(k) == i && p.window().now() - p.window()[i].frame <= p.window().max_gap();
    return is_listed ? s_.row_of[k] : kNone;
  }

  // Whether labels are given to the newest frame.
  static bool is_given(const Partition<Filter>& p) {
    const auto& ids = p.window().frame(p.window().now()).ids;
    return p.given() != nullptr && !ids.empty() && p.given()->covers(p.window()[ids.front()].number);
  }

  // Applies the given links. For each detection, stores the row of the track that it continues. The
  // first detections of a track, or those after a jolt, may be less probable in the track than as
  // clutter until more of them follow. So the given detections that are free are added with the next
  // one of their track.
  void give_links(const Partition<Filter>& p, ChainStats& stats) {
    const DetectionWindow& window = p.window();
    const auto& ids = window.frame(window.now()).ids;
    s_.row_given.assign(ids.size(), kNone);
    s_.is_continued.assign(s_.rows.size(), false);
    s_.n_edits = 0;
    s_.added.clear();
    if (p.given() == nullptr) return;
    for (std::size_t c = 0; c < ids.size(); ++c) {
      const std::int32_t j = ids[c];
      const std::int64_t label = p.given_label(j);
      if (label < 0) continue;
      const auto [at, is_new] = before_.try_emplace(label);
      if (!is_new) ++stats.n_given;
      std::vector<Given>& before = at->second;
      std::erase_if(before, [&](const Given& each) {  // the number was reused for another detection
        return window[each.detection].number != each.number;
      });
      const std::int32_t i = before.empty() ? -1 : before.back().detection;
      const bool is_here = i >= 0 && window.is_linkable(i, j);
      const std::int32_t row = is_here ? row_ending_at(p, i) : kNone;
      if (row >= 0) {
        s_.row_given[c] = row;
      } else if (is_here && p.is_free(i)) {
        s_.row_given[c] = add_after_free(p, before, j);
      } else if (!is_new) {
        ++stats.n_refused;
      }
      before.push_back({j, window[j].number});
    }
  }

  // Adds detection j and the free detections before it with its label to the track that these
  // continue, or to a new one. Returns the row of the track, or kNewTrack.
  std::int32_t add_after_free(const Partition<Filter>& p, const std::vector<Given>& before,
                              std::int32_t j) {
    const auto is_linked = [&](std::size_t n) {
      return n > 0 && p.window().is_linkable(before[n - 1].detection, before[n].detection);
    };
    std::size_t first = before.size() - 1;
    while (is_linked(first) && p.is_free(before[first - 1].detection)) --first;
    const std::int32_t row =
        is_linked(first) ? row_ending_at(p, before[first - 1].detection) : kNone;
    Edit<Filter>& edit = next_edit();
    if (row >= 0) {
      s_.is_continued[row] = true;
      edit.track = s_.rows[row];
      edit.keep = p.track(edit.track).size();
    }
    for (; first < before.size(); ++first) append(p, edit, before[first].detection);
    append(p, edit, j);
    return row >= 0 ? row : kNewTrack;
  }

  // Lists candidates with a positive gain, and other plausible or given links.
  void list_candidates(const Partition<Filter>& p) {
    const DetectionWindow& window = p.window();
    const auto& ids = window.frame(window.now()).ids;
    const DetectionWindow::Places& places = *window.frame(window.now()).places;
    s_.is_given.assign(s_.rows.size(), false);
    for (const std::int32_t row : s_.row_given)
      if (row >= 0) s_.is_given[row] = true;
    for (Found& found : s_.found) found.clear();
    s_.found.resize(std::max(s_.found.size(), n_blocks(s_.rows.size())));
    in_blocks(s_.rows.size(), [&](typename Filter::Expected& expected, std::size_t block, std::size_t r) {
      const std::int32_t i = p.last(s_.rows[r]);
      const auto gap = static_cast<int>(window.now() - window[i].frame);
      p.filter().expect(p.motion(), window, p.state(i), window[i].frame, gap, expected);
      const double base = p.gap_score(gap) - p.end_score(i);
      const double radius = Filter::radius(expected, -base - within_, places.grid.max_r());
      if (radius < 0) return;
      Found& found = s_.found[block];
      places.grid.within(Filter::center(expected), radius, [&](std::int32_t j, double) {
        const double gain = base + Filter::log_likelihood(p.motion(), expected, places.points[j]);
        if (gain < -within_ || !window.is_linkable(i, ids[j])) return;
        const bool is_open = gain > 0 && !s_.is_given[r] && s_.row_given[j] == kNone;
        (is_open ? found.candidates : found.others)
            .push_back({static_cast<std::int32_t>(r), j, gain, 0});
      });
    });
    s_.candidates.clear();
    s_.others.clear();
    for (const Found& found : s_.found) {
      s_.candidates.insert(s_.candidates.end(), found.candidates.begin(), found.candidates.end());
      s_.others.insert(s_.others.end(), found.others.begin(), found.others.end());
    }
  }

  // Calls task(working memory of the thread, block, n) for every n below `size`.
  template <typename Task>
  void in_blocks(std::size_t size, Task&& task) {
    s_.expected_of.resize(std::max<std::size_t>(n_threads_, 1));
    in_parallel(static_cast<std::int64_t>(n_blocks(size)), n_threads_,
                [&](std::int32_t worker, std::int64_t k) {
      const auto block = static_cast<std::size_t>(k);
      const std::size_t end = std::min(size, (block + 1) * kBlock);
      for (std::size_t n = block * kBlock; n < end; ++n) task(s_.expected_of[worker], block, n);
    });
  }
  static std::size_t n_blocks(std::size_t size) { return (size + kBlock - 1) / kBlock; }

  // An empty edit, in the memory of one of an earlier frame.
  Edit<Filter>& next_edit() {
    if (s_.n_edits == s_.edits.size()) s_.edits.emplace_back();
    Edit<Filter>& edit = s_.edits[s_.n_edits++];
    edit.clear();
    return edit;
  }

  // Adds ambiguous links between a free detection of an earlier frame and one of the newest frame,
  // as the beginning of a track.
  void add_ambiguous_births(const Partition<Filter>& p, AmbiguousLinks& ambiguous) {
    const DetectionWindow& window = p.window();
    for (int gap = 1; gap <= window.max_gap(); ++gap) {
      const std::int64_t t = window.now() - gap;
      if (t < std::max(p.frozen() + 1, window.first())) break;
      const DetectionWindow::Frame& before = window.frame(t);
      if (before.ids.empty()) continue;
      Point begin{};
      begin.r = before.places->grid.max_r();
      const auto begun = p.filter().begin(p.motion(), begin, t);
      p.filter().expect(p.motion(), window, begun, t, gap, s_.expected);
      const double radius =
          Filter::radius(s_.expected, -p.begin_score() - p.gap_score(gap) - within_,
                         window.frame(window.now()).places->grid.max_r());
      if (radius < 0) continue;
      for (const std::int32_t j : window.frame(window.now()).ids)
        if (p.is_free(j))
          before.places->grid.within(window[j].y, radius, [&](std::int32_t n, double) {
            if (p.is_free(before.ids[n]) && window.is_linkable(before.ids[n], j))
              ambiguous.add(before.ids[n], j);
          });
    }
  }

  // For a track missed in this frame, adds ambiguous links from its detection before the last, in
  // case the last one is wrong.
  void add_ambiguous_before_last(const Partition<Filter>& p, std::int32_t last,
                                 AmbiguousLinks& ambiguous) {
    const DetectionWindow& window = p.window();
    const std::int32_t k = p.track_of(last), i = p.before(last);
    if (i < 0 || p.is_frozen(last) || window.now() - window[i].frame > window.max_gap()) return;
    const DetectionWindow::Frame& frame = window.frame(window.now());
    if (frame.ids.empty()) return;
    const auto gap = static_cast<int>(window.now() - window[i].frame);
    p.filter().expect(p.motion(), window, p.state(i), window[i].frame, gap, s_.expected);
    const double base = p.score(i) + p.gap_score(gap) - p.score_of(k);
    const double radius =
        Filter::radius(s_.expected, -base - within_, frame.places->grid.max_r());
    if (radius < 0) return;
    frame.places->grid.within(Filter::center(s_.expected), radius, [&](std::int32_t n, double) {
      const std::int32_t j = frame.ids[n];
      if (p.is_free(j) && window.is_linkable(i, j) &&
          base + Filter::log_likelihood(p.motion(), s_.expected, frame.places->points[n]) >
              -within_)
        ambiguous.add(i, j);
    });
  }

  // The links of a block of tracks.
  struct Found {
    std::vector<Candidate> candidates, others;

    void clear() {
      candidates.clear();
      others.clear();
    }
  };
  struct Memory {
    std::vector<std::int32_t> rows, row_given, match, missed;
    std::vector<std::int32_t> added;  // detections of the last edits
    std::vector<std::int32_t> row_of;  // by track, only for those listed in `rows`
    std::vector<char> is_given, is_continued;  // by row
    std::vector<Candidate> candidates, others;
    std::vector<Found> found;  // by block
    std::vector<Edit<Filter>> edits;  // the first `n_edits` are those of this frame
    std::size_t n_edits = 0;
    Assignment assignment;
    typename Filter::Expected expected;
    std::vector<typename Filter::Expected> expected_of;  // by thread
  };

  bool has_assignment_;
  double within_;  // ambiguous_within
  std::int32_t n_threads_;
  // The detections of each given label in the window.
  std::unordered_map<std::int64_t, std::vector<Given>> before_;
  Scratch<Memory> s_;
};

}  // namespace asterism
