// A partition of a window's detections into tracks and clutter, and its log posterior.
//
// Every detection of a track stores the track's filter state after it and the score up to it. These
// are the states and scores of all prefixes, as a detection is in at most one track. Shortening a
// track is therefore free, and extending it costs only the new detections. Detections of frames up
// to `frozen` are settled and do not change any more.
//
// A partition may cover a block of frames of a longer capture. Tracks that leave the block then end
// in a continuation (mcmc/model/continuations.hpp), which extends their score beyond the block. A
// continuation may be moved to another track, but must be in one.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/index_set.hpp"
#include "mcmc/model/continuations.hpp"
#include "mcmc/model/detection_window.hpp"
#include "mcmc/model/edits.hpp"
#include "mcmc/model/given_labels.hpp"
#include "mcmc/model/link_gains.hpp"
#include "mcmc/model/path_filter.hpp"

namespace asterism {

template <typename Filter>
class Partition {
 public:
  using State = typename Filter::State;
  using Track = PartitionTrack;

  Partition(const MotionModel& m, const ScoreModel& sm)
      : Partition(m, sm, std::make_shared<const std::vector<double>>(log_end_table(sm, kEndTable))) {}

  // An empty partition with the same model.
  Partition empty() const { return Partition(m_, sm_, log_end_); }

  // Sets labels of the detections to come, by which tracks are of markers.
  void give(std::shared_ptr<const GivenLabels> given) { given_ = std::move(given); }
  const GivenLabels* given() const { return given_.get(); }
  // Whether markers accelerate together.
  bool is_shared() const { return given_ != nullptr && given_->shared != nullptr; }
  // Sets detections of markers in the frames of the window that are not in it.
  void fix(std::vector<FixedPlace> places) { fixed_ = std::move(places); }
  const std::vector<FixedPlace>& fixed() const { return fixed_; }
  // From now on, the last detection of a track that leaves the frames stays with its marker.
  void keep_last_markers() { keeps_last_markers_ = true; }
  bool keeps_last_markers() const { return keeps_last_markers_; }
  std::int64_t given_label(std::int32_t i) const { return given_->of(window_[i].number); }
  // The marker of a track, which is the first label given to its detections; -1 for none. It does
  // not change once the first detection is settled.
  std::int32_t marker(std::int32_t k) const {
    const Track& t = track(k);
    return t.n_gone + t.n_frozen > 0 ? t.marker : marker_of(t.nodes);
  }
  std::int32_t marker_of(std::span<const std::int32_t> nodes) const {
    if (is_shared())
      for (const std::int32_t i : nodes)
        if (const std::int64_t label = given_label(i); label >= 0)
          return static_cast<std::int32_t>(label);
    return -1;
  }

  const DetectionWindow& window() const { return window_; }
  Filter& filter() const { return filter_; }  // mutable: it only caches values
  typename Filter::Expected& expected() const { return expected_; }  // working memory
  const Continuations<Filter>& continuations() const { return later_; }
  const MotionModel& motion() const { return m_; }
  const ScoreModel& model() const { return sm_; }

  // The number of a track is valid until an edit removes the track; it is then reused.
  const Track& track(std::int32_t k) const {
    assert(all_.has(k));
    return tracks_[k];
  }
  void set_id(std::int32_t k, std::int64_t id) {
    assert(all_.has(k));
    tracks_[k].id = id;
  }
  std::int32_t track_of(std::int32_t i) const { return track_of_[i]; }
  std::int32_t place_of(std::int32_t i) const { return place_[i]; }
  bool is_free(std::int32_t i) const { return track_of_[i] == kFree; }
  bool is_frozen(std::int32_t i) const { return window_[i].frame <= frozen_; }
  bool is_continuation(std::int32_t i) const { return window_[i].frame > window_.last_open(); }
  const State& state(std::int32_t i) const { return state_[i]; }
  double score(std::int32_t i) const { return score_[i]; }
  // The time of the partition advances with every change of a track. `changed` is the time of the
  // last change of the track of i, or of i itself if it is in none.
  std::int64_t clock() const { return clock_; }
  std::int64_t changed(std::int32_t i) const {
    return track_of_[i] >= 0 ? tracks_[track_of_[i]].stamp : stamp_[i];
  }
  // The gain of the score by a link from the present state of i to j; a reference to NaN if it is
  // not known yet.
  double& known_gain(std::int32_t i, std::int32_t j) const {
    return gains_.of(stamp_[i], window_.version(), j);
  }

  // Detections in no track, in a track, and in a track after another detection; none is settled.
  const IndexSet& free() const { return free_; }
  const IndexSet& taken() const { return taken_; }
  const IndexSet& linked() const { return linked_; }
  // The linked detections that follow a gap.
  const IndexSet& leapt() const { return leapt_; }
  // All tracks, and those without settled detections.
  const IndexSet& tracks() const { return all_; }
  const IndexSet& young() const { return young_; }

  // First and last detection of a track, and their frames.
  std::int32_t first(std::int32_t k) const { return begins_[k].detection; }
  std::int32_t last(std::int32_t k) const { return ends_[k].detection; }
  std::int64_t first_frame(std::int32_t k) const { return begins_[k].frame; }
  std::int64_t last_frame(std::int32_t k) const { return ends_[k].frame; }
  // The previous or next detection of the track, -1 if there is none.
  std::int32_t before(std::int32_t i) const {
    return place_[i] > 0 ? track(track_of_[i]).nodes[place_[i] - 1] : -1;
  }
  std::int32_t after(std::int32_t i) const {
    const Track& t = track(track_of_[i]);
    return place_[i] + 1 < t.size() ? t.nodes[place_[i] + 1] : -1;
  }

  double begin_score() const { return sm_.log_birth + sm_.log_detect - sm_.log_clutter; }
  double gap_score(int gap) const {
    return sm_.log_misses(0, gap - 1) + sm_.log_hit(gap - 1) - sm_.log_clutter +
           gap * sm_.log_survive;
  }
  double end_score(std::int32_t i) const {
    if (is_continuation(i)) return 0;  // the end of the track is unchanged
    const std::int64_t left = window_.now() + n_after_ - window_[i].frame;
    return (*log_end_)[std::min(left, kEndTable)];
  }
  double score_of(std::int32_t k) const {
    const std::int32_t i = last(k);
    return score_[i] + end_score(i);
  }
  // The edit must be filtered.
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

  // Applies the edits. A track without detections is removed and its number reused.
  void apply(std::span<Edit<Filter>> edits) {
    for (Edit<Filter>& edit : edits) {
      if (edit.track < 0) {
        edit.track = new_track();
        continue;
      }
      assert(all_.has(edit.track));
      Track& t = tracks_[edit.track];
      assert(edit.keep >= t.n_frozen && edit.keep <= t.size());
      t.stamp = ++clock_;
      for (std::int32_t p = edit.keep; p < t.size(); ++p) release(t.nodes[p]);
      t.nodes.resize(edit.keep);
      if (edit.keep > 0) end_at(edit.track, t.nodes.back());
    }
    for (const Edit<Filter>& edit : edits) {
      Track& t = tracks_[edit.track];
      for (std::size_t n = 0; n < edit.tail.nodes.size(); ++n) {
        const std::int32_t i = edit.tail.nodes[n];
        assert(is_free(i));
        free_.remove(i);
        put(edit.track, i, edit.tail.states[n], edit.tail.scores[n]);
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
        if (tracks_[k].n_gone + tracks_[k].n_frozen == 0) tracks_[k].marker = marker_of(tracks_[k].nodes);
        ++tracks_[k].n_frozen;
        young_.remove(k);
      }
    frozen_ = std::max(frozen_, frame);
  }
  std::int64_t frozen() const { return frozen_; }

  // Becomes the part of a partition with some of its tracks and free detections. Of each track it
  // contains all open detections and the last settled one.
  void take_part(const Partition& whole, std::span<const std::int32_t> tracks,
                 std::span<const std::int32_t> free) {
    given_ = whole.given_;
    keeps_last_markers_ = whole.keeps_last_markers_;
    frozen_ = whole.frozen_;
    n_after_ = whole.n_after_;
    later_.clear();
    origin_.clear();
    for (const std::int32_t k : tracks) {
      const Track& t = whole.tracks_[k];
      origin_.insert(origin_.end(), t.nodes.begin() + t.first_open(), t.nodes.end());
    }
    origin_.insert(origin_.end(), free.begin(), free.end());
    window_.take_part(whole.window_, origin_);
    filter_.remember(window_);
    clear(static_cast<std::int32_t>(origin_.size()));
    std::int32_t i = 0;
    for (const std::int32_t k : tracks) {
      const Track& t = whole.tracks_[k];
      const std::int32_t own = new_track();
      tracks_[own].n_frozen = std::min(t.n_frozen, 1);
      tracks_[own].n_gone = t.n_gone + t.first_open();
      tracks_[own].marker = t.marker;
      if (t.n_frozen > 0) young_.remove(own);
      for (std::int32_t p = t.first_open(); p < t.size(); ++p, ++i)
        adopt(own, i, whole.state_[t.nodes[p]], whole.score_[t.nodes[p]]);
      if (is_continuation(i - 1)) later_.set(i - 1, whole.later_.of(t.nodes.back()));
    }
    for (; i < static_cast<std::int32_t>(origin_.size()); ++i) free_.add(i);
  }
  // Number of a detection in the whole partition; the number itself if this is not a part.
  std::int32_t origin(std::int32_t i) const { return origin_.empty() ? i : origin_[i]; }

  // Ends a block of a longer capture at this frame. `n_after` frames of the capture follow the last
  // frame of the window.
  void close_after(std::int64_t frame, std::int64_t n_after) {
    window_.close_after(frame);
    n_after_ = n_after;
  }
  // Sets the detections after continuation i, which must not be in a track yet.
  void continue_with(std::int32_t i, LaterPoints later) {
    free_.remove(i);
    later_.set(i, std::move(later));
  }
  // Adds a track that begins, or continues earlier detections, with a settled one in a known state.
  // Its marker is the label given to that one.
  std::int32_t add_settled(std::int32_t i, const State& state, bool has_others_before) {
    const std::int32_t k = new_track();
    free_.remove(i);
    adopt(k, i, state, 0);
    tracks_[k].n_gone = has_others_before;
    tracks_[k].marker = marker_of(tracks_[k].nodes);
    return k;
  }

  // Removes the oldest frame, which must be settled.
  void drop_frame() {
    for (const std::int32_t i : window_.frame(window_.first()).ids) {
      const std::int32_t k = track_of_[i];
      if (k < 0) continue;
      Track& t = tracks_[k];
      t.nodes.erase(t.nodes.begin());
      --t.n_frozen;
      ++t.n_gone;
      for (const std::int32_t j : t.nodes) --place_[j];
      t.nodes.empty() ? remove_track(k) : begin_at(k, t.nodes.front());
    }
    window_.drop();
  }

  std::span<const std::int32_t> add_frame(double time, const MotionStep& step,
                                          std::span<const Point> points, std::int64_t number) {
    const auto ids = window_.add(time, step, points, number);
    reserve_up_to(window_.n_ids());
    for (const std::int32_t i : ids) {
      track_of_[i] = kFree;
      free_.add(i);
    }
    return ids;
  }

 private:
  static constexpr std::int64_t kEndTable = 4096;

  Partition(const MotionModel& m, const ScoreModel& sm,
            std::shared_ptr<const std::vector<double>> log_end)
      : m_(m), sm_(sm), window_(m, sm), log_end_(std::move(log_end)) {}

  void reserve_up_to(std::int32_t n) {
    if (static_cast<std::int32_t>(track_of_.size()) >= n) return;
    track_of_.resize(n, kFree);
    place_.resize(n);
    state_.resize(n);
    stamp_.resize(n);
    score_.resize(n);
    for (IndexSet* set : {&free_, &taken_, &linked_, &leapt_}) set->reserve_up_to(n);
  }
  // Removes all tracks and resets n detections.
  void clear(std::int32_t n) {
    for (IndexSet* set : {&free_, &taken_, &linked_, &leapt_, &all_, &young_}) set->clear();
    reserve_up_to(n);
    std::fill_n(track_of_.begin(), n, kFree);
    unused_.clear();
    n_used_ = 0;
  }

  // Adds a detection at the end of a track.
  void put(std::int32_t k, std::int32_t i, const State& state, double score) {
    track_of_[i] = k;
    place_[i] = tracks_[k].size();
    state_[i] = state;
    stamp_[i] = ++clock_;
    score_[i] = score;
    if (place_[i] == 0) begin_at(k, i);
    end_at(k, i);
    tracks_[k].nodes.push_back(i);
    if (!is_frozen(i)) list(i);
  }
  void begin_at(std::int32_t k, std::int32_t i) { begins_[k] = {i, window_[i].frame}; }
  void end_at(std::int32_t k, std::int32_t i) { ends_[k] = {i, window_[i].frame}; }
  void adopt(std::int32_t k, std::int32_t i, const State& state, double score) {
    put(k, i, state, score);
    filter_.adopt(state_[i]);
  }
  // Adds a detection to the sets from which moves draw.
  void list(std::int32_t i) {
    taken_.add(i);
    if (place_[i] == 0) return;
    linked_.add(i);
    if (window_[i].frame - window_[before(i)].frame > 1) leapt_.add(i);
  }
  void release(std::int32_t i) {
    track_of_[i] = kFree;
    stamp_[i] = ++clock_;
    taken_.remove(i);
    linked_.remove(i);
    leapt_.remove(i);
    free_.add(i);
  }
  std::int32_t new_track() {
    std::int32_t k = n_used_;
    if (!unused_.empty()) {
      k = unused_.back();
      unused_.pop_back();
    } else if (++n_used_ > static_cast<std::int32_t>(tracks_.size())) {
      tracks_.emplace_back();
      begins_.emplace_back();
      ends_.emplace_back();
      all_.reserve_up_to(k + 1);
      young_.reserve_up_to(k + 1);
    }
    tracks_[k].nodes.clear();
    tracks_[k].n_frozen = tracks_[k].n_gone = 0;
    tracks_[k].id = -1;
    tracks_[k].marker = -1;
    tracks_[k].stamp = ++clock_;
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
  std::shared_ptr<const std::vector<double>> log_end_;
  std::shared_ptr<const GivenLabels> given_;
  bool keeps_last_markers_ = false;
  std::vector<FixedPlace> fixed_;
  std::int64_t frozen_ = -1;
  std::int64_t n_after_ = 0;  // frames of the capture after the window
  Continuations<Filter> later_;
  std::vector<Track> tracks_;
  // Beside the tracks, because moves compare the ends of all of them.
  struct End {
    std::int32_t detection = -1;
    std::int64_t frame = 0;
  };
  std::vector<End> begins_, ends_;
  std::int32_t n_used_ = 0;           // numbers of tracks that have been used
  std::vector<std::int32_t> unused_;  // those of them that no track has any more
  IndexSet free_, taken_, linked_, leapt_, all_, young_;
  std::vector<std::int32_t> track_of_, place_;
  std::vector<State> state_;
  std::vector<std::int64_t> stamp_;  // of the state, or of the release
  std::int64_t clock_ = 0;
  std::vector<double> score_;
  mutable Filter filter_;
  mutable LinkGains gains_;
  mutable typename Filter::Expected expected_{};  // scratch
  std::vector<std::int32_t> origin_;  // of a part: numbers of its detections in the whole partition
};

}  // namespace asterism
