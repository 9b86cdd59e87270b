// MCMC data association on a stream: a window of frames in which the chain may still change its mind,
// and behind it what is settled.
//
// Per frame: the exact assignment of its detections to what the tracks expect, as a start; the chain;
// the best partition met; and the frame that leaves the window is settled by it. Of what is settled only
// the filter states are needed, so that frames older than the longest gap are forgotten.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "assignment.hpp"
#include "bonds.hpp"
#include "doubts.hpp"
#include "fresh.hpp"
#include "live_tracks.hpp"
#include "parallel.hpp"
#include "split.hpp"
#include "walker.hpp"

namespace asterism {

struct McmcOptions {
  std::int32_t window = 1;     // frames until one is settled
  double moves = 0;            // in each frame, for each of its detections or for each track
  double deadline = 0;         // seconds from the frame's arrival; 0: none
  bool has_assignment = true;  // start from the exact assignment; else from no change
  double confidence = 0;       // moves for confidence, as above; 0: none
  std::int32_t n_chains = 1, n_threads = 1;
  SplitOptions split;
  BondOptions bonds;
};

template <typename Filter>
class McmcTracker {
 public:
  McmcTracker(const MotionModel& m, const ScoreModel& sm, const ChainOptions& chain,
              const McmcOptions& options, std::uint64_t seed)
      : partition_(m, sm), chain_(chain), opt_(options), seed_(seed) {}

  template <typename Label>
  FrameStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const FrameStats stats = add(time, step, points);
    name_new();
    tell(label);
    settle();
    return stats;
  }

  // Many frames whose labels are asked for at the end alone.
  template <typename Label>
  FrameStats pass(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const FrameStats stats = add(time, step, points);
    name_new();
    if (oldest_open() <= partition().window().now() - opt_.window) tell(label, oldest_open());
    settle();
    return stats;
  }
  template <typename Label>
  void end_pass(Label&& label) {
    name_new();
    tell(label);
  }

  bool has_confidence() const { return opt_.confidence > 0; }
  std::int64_t n_frames() const { return n_frames_; }
  std::int64_t n_seen() const { return n_seen_; }
  double last_time() const { return last_time_; }
  FrameStats total() const { return total_; }
  const Partition<Filter>& partition() const { return partition_; }

  const MotionModel& motion() const { return partition().motion(); }
  std::int64_t n_ids() const { return next_id_ + n_named_; }
  // The tracks as they would be settled now.
  LiveTracks<> live() const {
    const Partition<Filter>& p = partition();
    LiveTracks<> live(p.motion(), p.model(), {});
    live.next_id = n_ids();
    for (const std::int32_t k : p.tracks().items()) {
      const std::int32_t i = p.last(k);
      LiveTrack<NoMore>& track = live.tracks.emplace_back();
      track.id = id_of(k);
      track.gap = static_cast<std::int32_t>(p.window().now() - p.window()[i].frame);
      track.score = p.score(i);
      track.state = state_now(i);
    }
    std::sort(live.tracks.begin(), live.tracks.end(),
              [](const auto& a, const auto& b) { return a.id < b.id; });
    return live;
  }

 private:
  struct Memory {
    std::vector<Candidate> candidates;
    std::vector<std::int32_t> match;
    std::vector<Edit<Filter>> edits;
    Assignment assignment;
    std::vector<std::unique_ptr<Walker<Filter>>> walkers;
  };

  FrameStats add(double time, const MotionStep& step, std::span<const Point> points) {
    const auto arrival = Clock::now();
    Partition<Filter>& p = partition_;
    p.add_frame(time, step, points, n_seen_);
    n_seen_ += static_cast<std::int64_t>(points.size());
    last_time_ = time;
    ++n_frames_;
    FrameStats stats;
    doubts_.add_frame();
    assign(stats);
    doubt_births();
    const Bonds bonds = BondFinder<Filter>(p, opt_.bonds).find();
    stats.chain.n_sure = bonds.n_sure;
    const Split split = Splitter<Filter>(p, opt_.split).split(doubts_, bonds.is_sure);
    stats.n_groups = split.n_all;
    for (const Group& group : split.groups)
      stats.largest_group = std::max<std::int64_t>(
          stats.largest_group, static_cast<std::int64_t>(group.tracks.size() + group.free.size()));
    stats.chain.n_walked = static_cast<std::int64_t>(split.groups.size());
    stats.chain.n_cut = split.n_cut;
    search(split.groups, arrival, stats.chain);
    if (has_confidence()) sample(bonds.is_sure, arrival, stats.chain);
    stats.n_confirmed = p.tracks().size();
    stats.n_pending = p.free().size() + p.taken().size();
    total_.add(stats);
    return stats;
  }

  // The newest frame's detections to the tracks, for the greatest gain in the log posterior; and what
  // other tracks might have them.
  void assign(FrameStats& stats) {
    Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    const auto& ids = window.frame(window.now()).ids;
    s_.candidates.clear();
    const DetectionWindow::Places& places = *window.frame(window.now()).places;
    std::vector<std::int32_t> rows;
    std::vector<Candidate> weak;
    typename Filter::Expected expected;
    for (const std::int32_t k : p.tracks().items()) {
      const std::int32_t i = p.last(k);
      const std::int64_t gap = window.now() - window[i].frame;
      if (gap < 1 || gap > window.max_gap()) continue;
      p.filter().expect(p.motion(), window, p.state(i), window[i].frame, static_cast<int>(gap), expected);
      const double base = p.gap_score(static_cast<int>(gap)) - p.end_score(i);
      const double radius = Filter::radius(expected, -base - opt_.split.doubt);
      if (radius < 0) continue;
      places.grid.within(Filter::center(expected), radius, [&](std::int32_t j, double) {
        const double gain = base + Filter::log_likelihood(p.motion(), expected, places.points[j]);
        if (gain < -opt_.split.doubt || !window.is_linkable(i, ids[j])) return;
        (gain > 0 ? s_.candidates : weak)
            .push_back({static_cast<std::int32_t>(rows.size()), j, gain, 0});
      });
      rows.push_back(k);
    }
    stats.n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    const Groups groups =
        connected_groups(s_.candidates, static_cast<std::int32_t>(rows.size()),
                         static_cast<std::int32_t>(ids.size()));
    s_.match.assign(rows.size(), -1);
    for (std::size_t g = 0; g < groups.size(); ++g) s_.assignment.solve(groups[g], s_.match);
    for (const auto* list : {&s_.candidates, &weak})
      for (const Candidate& c : *list)
        if (s_.match[c.row] != c.column || c.gain < opt_.split.doubt)
          doubts_.add(p.last(rows[c.row]), ids[c.column]);
    if (!opt_.has_assignment) return;
    s_.edits.clear();
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (s_.match[r] < 0) continue;
      Edit<Filter>& edit = s_.edits.emplace_back();
      edit.track = rows[r];
      edit.keep = p.track(rows[r]).size();
      p.append(edit, ids[s_.match[r]]);
    }
    p.apply(s_.edits);
  }

  // Free detections from which a track may have begun that goes on with one of the newest frame.
  void doubt_births() {
    const Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    typename Filter::Expected expected;
    for (int gap = 1; gap <= window.max_gap(); ++gap) {
      const std::int64_t t = window.now() - gap;
      if (t < std::max(oldest_open(), window.first())) break;
      const DetectionWindow::Frame& before = window.frame(t);
      if (before.ids.empty()) continue;
      p.filter().expect(p.motion(), window, p.filter().begin(p.motion(), Point{}, t), t, gap, expected);
      const double base = p.begin_score() + p.gap_score(gap);
      const double radius = Filter::radius(expected, -base - opt_.split.doubt);
      if (radius < 0) continue;
      for (const std::int32_t j : window.frame(window.now()).ids)
        if (p.is_free(j))
          before.places->grid.within(window[j].y, radius, [&](std::int32_t n, double) {
            if (p.is_free(before.ids[n]) && window.is_linkable(before.ids[n], j))
              doubts_.add(before.ids[n], j);
          });
    }
  }

  // A number that is the same for the same frame, group and chain, whoever draws with it.
  std::uint64_t seed_of(int phase, std::int64_t group, std::int64_t chain) const {
    std::uint64_t seed = seed_;
    for (const std::int64_t part : {n_frames_, static_cast<std::int64_t>(phase), group, chain})
      seed = Random(seed ^ static_cast<std::uint64_t>(part)).next();
    return seed;
  }

  // Shares of the moves and of the time, by size.
  class Budgets {
   public:
    Budgets(const std::vector<Group>& groups, const McmcOptions& options, double moves,
            Clock::time_point arrival, double share)
        : has_deadline_(options.deadline > 0) {
      double all = 0;
      for (const Group& group : groups) all += markers(group);
      const std::chrono::duration<double> allowed(options.deadline * share);
      end_ = arrival + std::chrono::duration_cast<Clock::duration>(allowed);
      const double left = std::chrono::duration<double>(end_ - Clock::now()).count();
      const auto n_tasks = static_cast<double>(groups.size()) * options.n_chains;
      const double workers = std::min<double>(options.n_threads, n_tasks);
      for (const Group& group : groups) {
        // A deadline alone sets no end to the moves.
        moves_.push_back(static_cast<std::int64_t>(std::min(std::ceil(moves * markers(group)), 1e15)));
        seconds_.push_back(left * workers * markers(group) / (all * options.n_chains));
      }
    }
    Budget of(std::int64_t g) const {
      if (!has_deadline_) return {moves_[g]};
      const std::chrono::duration<double> own(seconds_[g]);
      return {moves_[g],
              std::min(end_, Clock::now() + std::chrono::duration_cast<Clock::duration>(own))};
    }

   private:
    static double markers(const Group& group) {
      return static_cast<double>(
          std::max<std::int64_t>(group.n_new, static_cast<std::int64_t>(group.tracks.size())));
    }
    bool has_deadline_;
    Clock::time_point end_;
    std::vector<std::int64_t> moves_;
    std::vector<double> seconds_;
  };

  Walker<Filter>& walker(std::int32_t w) { return *s_.walkers[w]; }
  void make_walkers() {
    while (static_cast<std::int32_t>(s_.walkers.size()) < opt_.n_threads)
      s_.walkers.push_back(std::make_unique<Walker<Filter>>(partition_.empty(), chain_));
  }

  // Each group as the best of its chains has it.
  void search(const std::vector<Group>& groups, Clock::time_point arrival, ChainStats& stats) {
    struct Found {
      double gain = 0;
      ChainStats stats;
      std::optional<Partition<Filter>> part;
    };
    const Budgets budgets(groups, opt_, opt_.moves, arrival, has_confidence() ? 0.5 : 1.0);
    const std::int64_t n_chains = opt_.n_chains;
    std::vector<Found> found(groups.size() * n_chains);
    make_walkers();
    in_parallel(static_cast<std::int64_t>(found.size()), opt_.n_threads,
                [&](std::int32_t w, std::int64_t task) {
                  const std::int64_t g = task / n_chains;
                  Found& own = found[task];
                  own.gain = walker(w).search(partition_, groups[g], seed_of(0, g, task % n_chains),
                                              budgets.of(g), own.stats);
                  if (own.gain > 0) own.part = walker(w).partition();
                });
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const auto first = found.begin() + g * n_chains, last = first + n_chains;
      for (auto one = first; one != last; ++one) stats.add(one->stats);
      const auto best = std::max_element(
          first, last, [](const Found& a, const Found& b) { return a.gain < b.gain; });
      if (best->gain > 0) partition_.take_over(*best->part, groups[g].tracks);
    }
  }

  // How probable it is that the open detections follow what they follow.
  void sample(const std::vector<char>& is_sure, Clock::time_point arrival, ChainStats& stats) {
    // The search may have made other tracks.
    const Split split = Splitter<Filter>(partition_, opt_.split).split(doubts_, is_sure);
    const Budgets budgets(split.groups, opt_, opt_.confidence, arrival, 1.0);
    const std::int64_t n_chains = opt_.n_chains;
    std::vector<Halves> found(split.groups.size() * n_chains);
    std::vector<ChainStats> counts(found.size());
    in_parallel(static_cast<std::int64_t>(found.size()), opt_.n_threads,
                [&](std::int32_t w, std::int64_t task) {
                  const std::int64_t g = task / n_chains;
                  walker(w).sample(partition_, split.groups[g], seed_of(1, g, task % n_chains),
                                   budgets.of(g), found[task], counts[task]);
                });
    for (const ChainStats& one : counts) stats.add(one);
    shares_now_.assign(partition_.window().n_ids(), 1.0);
    for (std::size_t g = 0; g < split.groups.size(); ++g)
      judge(std::span(found).subspan(g * n_chains, n_chains), stats);
    keep_shares();
  }
  // Once the detection before is settled, whether it is right is no longer asked: what a link was
  // believed to be while both its ends were open stays.
  void keep_shares() {
    const Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    shares_.resize(window.n_ids());
    for (std::int64_t t = oldest_open(); t <= window.now(); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int32_t before = p.track_of(i) < 0 ? -2 : p.before(i);
        Share& kept = shares_[i];
        if (before >= 0 && p.is_frozen(before) && kept.before == before) continue;
        kept = {shares_now_[i], before};
      }
  }
  void judge(std::span<const Halves> chains, ChainStats& stats) {
    const auto n_halves = static_cast<double>(chains.size() * Halves::kN);
    double mean = 0, within = 0, between = 0, ess = 0;
    for (const Halves& chain : chains) {
      ess += chain.ess;
      for (int h = 0; h < Halves::kN; ++h) {
        mean += chain.mean[h] / n_halves;
        within += chain.variance[h] / n_halves;
      }
    }
    for (const Halves& chain : chains)
      for (int h = 0; h < Halves::kN; ++h)
        between += (chain.mean[h] - mean) * (chain.mean[h] - mean) / (n_halves - 1);
    // Split R̂ (Gelman et al. 2013), for long halves.
    if (within > 0) stats.rhat = std::max(stats.rhat, std::sqrt(1 + between / within));
    stats.ess = std::min(stats.ess, ess);
    for (std::size_t n = 0; n < chains[0].detections.size(); ++n) {
      double sum = 0, least = 1, most = 0;
      for (const Halves& chain : chains)
        for (const std::vector<double>& shares : chain.shares) {
          sum += shares[n] / n_halves;
          least = std::min(least, shares[n]);
          most = std::max(most, shares[n]);
        }
      shares_now_[chains[0].detections[n]] = std::clamp(sum, 0.0, 1.0);
      stats.n_doubtful += most - least > 0.1;
    }
  }

  std::int64_t oldest_open() const { return partition().frozen() + 1; }

  // Tracks of which nothing is settled get the numbers that they would be settled with.
  void name_new() {
    Partition<Filter>& p = partition_;
    std::vector<std::pair<std::int64_t, std::int32_t>> unnamed;  // first detection, track
    for (const std::int32_t k : p.young().items())
      unnamed.emplace_back(p.window()[p.track(k).nodes.front()].number, k);
    std::sort(unnamed.begin(), unnamed.end());
    n_named_ = static_cast<std::int64_t>(unnamed.size());
    for (std::int64_t n = 0; n < n_named_; ++n) p.set_id(unnamed[n].second, next_id_ + n);
  }
  std::int64_t id_of(std::int32_t track) const { return partition().track(track).id; }

  // Tells the labels of the open frames that are not what was told.
  template <typename Label>
  void tell(Label&& label, std::int64_t last = std::numeric_limits<std::int64_t>::max()) {
    const Partition<Filter>& p = partition();
    const DetectionWindow& window = p.window();
    if (static_cast<std::int32_t>(said_.size()) < window.n_ids()) said_.resize(window.n_ids());
    for (std::int64_t t = oldest_open(); t <= std::min(last, window.now()); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int32_t k = p.track_of(i);
        const Said now{k < 0 ? -1 : id_of(k), confidence_of(i)};
        if (now == said_[i]) continue;
        said_[i] = now;
        label(window[i].number, now.id, now.confidence);
      }
  }
  // That the link to the detection before is right; of the first the one after, of clutter that it is
  // in no track.
  double confidence_of(std::int32_t i) const {
    if (!has_confidence()) return 0;
    const Partition<Filter>& p = partition();
    const bool is_first = p.track_of(i) >= 0 && p.place_of(i) == 0 && p.track(p.track_of(i)).n_gone == 0;
    return shares_[is_first ? p.after(i) : i].share;
  }

  // Settles what is older than the window, and forgets what nothing can follow any more.
  void settle() {
    Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    const std::int64_t settled = window.now() - opt_.window;
    if (settled < oldest_open()) return;
    p.freeze(settled);
    doubts_.keep(static_cast<std::size_t>(window.now() - settled));
    // Numbers of tracks that are settled now are theirs.
    for (const std::int32_t k : p.tracks().items())
      if (p.track(k).n_frozen > 0) next_id_ = std::max(next_id_, id_of(k) + 1);
    while (window.first() + window.max_gap() <= settled) {
      for (const std::int32_t i : window.frame(window.first()).ids)
        {
          if (i < static_cast<std::int32_t>(said_.size())) said_[i] = {};
          if (i < static_cast<std::int32_t>(shares_.size())) shares_[i] = {};
        }
      p.drop_frame();
    }
  }

  MotionState state_now(std::int32_t i) const {
    const Partition<Filter>& p = partition();
    const DetectionWindow& window = p.window();
    const int gap = static_cast<int>(window.now() - window[i].frame);
    MotionState out{};
    if constexpr (std::is_same_v<Filter, OneMotion>) {
      out.mode[0] = p.state(i);
      out.w[0] = 1;
    } else {
      out = p.state(i);
    }
    for (int d = 1; d <= gap; ++d) predict(p.motion(), window.frame(window[i].frame + d).steps->step, out);
    return out;
  }

  Partition<Filter> partition_;
  ChainOptions chain_;
  McmcOptions opt_;
  std::uint64_t seed_;
  Doubts doubts_;
  // By detection of the window: how probable it is that it follows what it follows, as of now and as it
  // is told; and what was told.
  std::vector<double> shares_now_;
  struct Share {
    double share = 1;
    std::int32_t before = -3;
  };
  std::vector<Share> shares_;
  struct Said {
    std::int64_t id = -1;
    double confidence = -1;
    bool operator==(const Said&) const = default;
  };
  std::vector<Said> said_;
  std::int64_t next_id_ = 0, n_named_ = 0;
  FrameStats total_;
  std::int64_t n_frames_ = 0, n_seen_ = 0;
  double last_time_ = -std::numeric_limits<double>::infinity();
  Fresh<Memory> s_;
};

}  // namespace asterism
