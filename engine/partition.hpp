// A partition of a window's detections into tracks and clutter, and its log posterior.
//
// Every detection in a track keeps the track's state right after it and the score up to it. A
// detection is in one track at most, so that this is all there is to know of every prefix: to end a
// track earlier costs nothing, to lengthen it only what is new.
//
// Frames up to `frozen` are settled: their detections stay where they are.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "detection_window.hpp"
#include "index_set.hpp"
#include "path_filter.hpp"

namespace asterism {

inline constexpr std::int32_t kFree = -1;     // in no track
inline constexpr std::int32_t kClutter = -2;  // in none, and settled

// What follows in a track after some of its detections are kept.
template <typename Filter>
struct Tail {
  std::vector<std::int32_t> nodes;
  std::vector<typename Filter::State> states;
  std::vector<double> scores;

  void clear() {
    nodes.clear();
    states.clear();
    scores.clear();
  }
};

// A track that keeps its first detections and goes on with a tail; a new one has no number.
template <typename Filter>
struct Edit {
  std::int32_t track = -1;
  std::int32_t keep = 0;
  Tail<Filter> tail;
};

template <typename Filter>
class Partition {
 public:
  using State = typename Filter::State;
  struct Track {
    std::vector<std::int32_t> nodes;
    std::int32_t n_frozen = 0;
    std::int32_t n_gone = 0;  // detections before the first, which have left the window
    std::int64_t id = -1;     // by which the outside knows it, once something of it is settled

    std::int32_t size() const { return static_cast<std::int32_t>(nodes.size()); }
    std::int32_t whole_size() const { return n_gone + size(); }
  };

  Partition(const MotionModel& m, const ScoreModel& sm)
      : m_(m), sm_(sm), window_(m, sm), log_end_(log_end_table(sm, kEndTable)) {}

  const DetectionWindow& window() const { return window_; }
  const MotionModel& motion() const { return m_; }
  const ScoreModel& model() const { return sm_; }

  const Track& track(std::int32_t k) const { return tracks_[k]; }
  void set_id(std::int32_t k, std::int64_t id) { tracks_[k].id = id; }
  std::int32_t track_of(std::int32_t i) const { return track_of_[i]; }
  std::int32_t place_of(std::int32_t i) const { return place_[i]; }
  bool is_free(std::int32_t i) const { return track_of_[i] == kFree; }
  bool is_frozen(std::int32_t i) const { return window_[i].frame <= frozen_; }
  const State& state(std::int32_t i) const { return state_[i]; }
  double score(std::int32_t i) const { return score_[i]; }

  // Detections that are in no track, in one, and in one with another before them; all not frozen.
  const IndexSet& free() const { return free_; }
  const IndexSet& taken() const { return taken_; }
  const IndexSet& linked() const { return linked_; }
  // Of these, the ones before which their track was missed in some frame.
  const IndexSet& leapt() const { return leapt_; }
  // Tracks, and those of which nothing is frozen.
  const IndexSet& tracks() const { return all_; }
  const IndexSet& young() const { return young_; }

  std::int32_t last(std::int32_t k) const { return tracks_[k].nodes.back(); }
  // The detection before or after in the track, -1 where there is none.
  std::int32_t before(std::int32_t i) const {
    return place_[i] > 0 ? tracks_[track_of_[i]].nodes[place_[i] - 1] : -1;
  }
  std::int32_t after(std::int32_t i) const {
    const Track& t = tracks_[track_of_[i]];
    return place_[i] + 1 < t.size() ? t.nodes[place_[i] + 1] : -1;
  }

  double begin_score() const { return sm_.log_birth + sm_.log_detect - sm_.log_clutter; }
  double gap_score(int gap) const {
    return sm_.log_detect - sm_.log_clutter + gap * sm_.log_survive + (gap - 1) * sm_.log_miss;
  }
  double end_score(std::int32_t i) const {
    const std::int64_t left = window_.now() - window_[i].frame;
    return log_end_[std::min(left, kEndTable)];
  }
  double score_of(std::int32_t k) const {
    const std::int32_t i = last(k);
    return score_[i] + end_score(i);
  }
  double score_of(const Edit<Filter>& edit) const {
    if (!edit.tail.nodes.empty()) return edit.tail.scores.back() + end_score(edit.tail.nodes.back());
    if (edit.keep == 0) return 0;
    const std::int32_t i = tracks_[edit.track].nodes[edit.keep - 1];
    return score_[i] + end_score(i);
  }
  double log_posterior() const {
    double sum = 0;
    for (const std::int32_t k : all_.items()) sum += score_of(k);
    return sum;
  }

  // Adds a detection to the tail of an edit, with all that follows from it.
  void append(Edit<Filter>& edit, std::int32_t j) const {
    Tail<Filter>& tail = edit.tail;
    State& state = tail.states.emplace_back();
    if (edit.keep == 0 && tail.nodes.empty()) {
      state = Filter::begin(m_, window_[j].y);
      tail.scores.push_back(begin_score());
    } else {
      const bool is_first = tail.nodes.empty();
      const std::int32_t i =
          is_first ? tracks_[edit.track].nodes[edit.keep - 1] : tail.nodes.back();
      const State& from = is_first ? state_[i] : tail.states[tail.states.size() - 2];
      const int gap = static_cast<int>(window_[j].frame - window_[i].frame);
      Expected<State> expected;
      Filter::expect(m_, window_, from, window_[i].frame, gap, expected);
      const double gain = gap_score(gap) + Filter::take(m_, expected, window_[j].y, state);
      tail.scores.push_back((is_first ? score_[i] : tail.scores.back()) + gain);
    }
    tail.nodes.push_back(j);
  }

  // Takes the edits over. A track that keeps nothing is gone, its number free for others.
  void apply(std::span<Edit<Filter>> edits) {
    for (Edit<Filter>& edit : edits) {
      if (edit.track < 0) {
        edit.track = new_track();
        continue;
      }
      Track& t = tracks_[edit.track];
      for (std::int32_t p = edit.keep; p < t.size(); ++p) release(t.nodes[p]);
      t.nodes.resize(edit.keep);
    }
    for (const Edit<Filter>& edit : edits) {
      Track& t = tracks_[edit.track];
      for (std::size_t n = 0; n < edit.tail.nodes.size(); ++n) {
        const std::int32_t i = edit.tail.nodes[n];
        track_of_[i] = edit.track;
        place_[i] = t.size();
        state_[i] = edit.tail.states[n];
        score_[i] = edit.tail.scores[n];
        free_.remove(i);
        if (!is_frozen(i)) {
          taken_.add(i);
          if (t.size() > 0) {
            linked_.add(i);
            if (window_[i].frame - window_[t.nodes.back()].frame > 1) leapt_.add(i);
          }
        }
        t.nodes.push_back(i);
      }
      if (t.nodes.empty()) remove_track(edit.track);
    }
  }

  // Settles all frames up to this one.
  void freeze(std::int64_t frame) {
    for (std::int64_t t = std::max(frozen_ + 1, window_.first()); t <= frame; ++t)
      for (const std::int32_t i : window_.frame(t).ids) {
        free_.remove(i);
        taken_.remove(i);
        linked_.remove(i);
        leapt_.remove(i);
        const std::int32_t k = track_of_[i];
        if (k == kFree) track_of_[i] = kClutter;
        if (k < 0) continue;
        ++tracks_[k].n_frozen;
        young_.remove(k);
      }
    frozen_ = std::max(frozen_, frame);
  }
  std::int64_t frozen() const { return frozen_; }

  // Forgets the oldest frame, which is settled.
  void drop_frame() {
    for (const std::int32_t i : window_.frame(window_.first()).ids) {
      const std::int32_t k = track_of_[i];
      if (k < 0) continue;
      Track& t = tracks_[k];
      t.nodes.erase(t.nodes.begin());
      --t.n_frozen;
      ++t.n_gone;
      for (const std::int32_t j : t.nodes) --place_[j];
      if (t.nodes.empty()) remove_track(k);
    }
    window_.drop();
  }

  std::span<const std::int32_t> add_frame(double time, const MotionStep& step,
                                          std::span<const Point> points, std::int64_t number) {
    const auto ids = window_.add(time, step, points, number);
    const std::int32_t n = window_.n_ids();
    if (static_cast<std::int32_t>(track_of_.size()) < n) {
      track_of_.resize(n, kFree);
      place_.resize(n);
      state_.resize(n);
      score_.resize(n);
      free_.reserve_up_to(n);
      taken_.reserve_up_to(n);
      linked_.reserve_up_to(n);
      leapt_.reserve_up_to(n);
    }
    for (const std::int32_t i : ids) {
      track_of_[i] = kFree;
      free_.add(i);
    }
    return ids;
  }

 private:
  static constexpr std::int64_t kEndTable = 4096;

  void release(std::int32_t i) {
    track_of_[i] = kFree;
    taken_.remove(i);
    linked_.remove(i);
    leapt_.remove(i);
    free_.add(i);
  }
  std::int32_t new_track() {
    std::int32_t k = static_cast<std::int32_t>(tracks_.size());
    if (unused_.empty()) {
      tracks_.emplace_back();
      all_.reserve_up_to(k + 1);
      young_.reserve_up_to(k + 1);
    } else {
      k = unused_.back();
      unused_.pop_back();
    }
    tracks_[k].n_frozen = tracks_[k].n_gone = 0;
    tracks_[k].id = -1;
    all_.add(k);
    young_.add(k);
    return k;
  }
  void remove_track(std::int32_t k) {
    all_.remove(k);
    young_.remove(k);
    unused_.push_back(k);
  }

  MotionModel m_;
  ScoreModel sm_;
  DetectionWindow window_;
  std::vector<double> log_end_;
  std::int64_t frozen_ = -1;
  std::vector<Track> tracks_;
  std::vector<std::int32_t> unused_;
  IndexSet free_, taken_, linked_, leapt_, all_, young_;
  std::vector<std::int32_t> track_of_, place_;
  std::vector<State> state_;
  std::vector<double> score_;
};

}  // namespace asterism
