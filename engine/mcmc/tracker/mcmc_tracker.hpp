// MCMC data association on a stream. The chain may change the associations of a window of frames;
// older frames are settled.
//
// In each frame, the chain starts from the exact assignment of the detections to predicted tracks, or
// from labels that are given.
// The best partition found settles the frame that leaves the window. Only filter states of settled
// frames are needed later, so frames older than the longest gap are removed.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "mcmc/chain/ambiguous_links.hpp"
#include "mcmc/chain/budgets.hpp"
#include "mcmc/chain/parallel_chains.hpp"
#include "mcmc/chain/split.hpp"
#include "mcmc/model/rigid_cliques.hpp"
#include "mcmc/tracker/capture_sweep.hpp"
#include "mcmc/tracker/frame_start.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

struct McmcOptions {
  std::int32_t window = 1;     // frames until one is settled
  bool is_whole = false;       // at the end the chains run again over all frames, block by block
  std::int32_t block = 1;      // frames of a block
  double moves = 0;            // in each frame, per detection or per track, whichever is more
  double deadline = 0;         // seconds from the frame's arrival; 0: none
  bool has_assignment = true;  // without labels, start from the exact assignment
  double confidence = 0;       // moves to estimate confidence, as above; 0: none
  std::int32_t n_chains = 1, n_threads = 1;
  SplitOptions split;
  BondOptions bonds;
};

template <typename Filter>
class McmcTracker {
 public:
  McmcTracker(const MotionModel& m, const ScoreModel& sm, const ChainOptions& chain,
              const McmcOptions& options, std::uint64_t seed)
      : partition_(m, sm),
        opt_(options),
        seed_(seed),
        start_(options.has_assignment, options.split.ambiguous_within, options.n_threads),
        chains_(chain, options.n_chains, options.n_threads),
        is_draw_(chain.is_draw),
        sweep_(options.block, sm.max_gap) {}

  template <typename Label>
  SampledStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const SampledStats stats = add(time, step, points);
    name_new();
    report(label);
    settle();
    return stats;
  }

  // Processes one of many frames whose labels are needed only at the end.
  template <typename Label>
  SampledStats pass(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const SampledStats stats = add(time, step, points);
    name_new();
    if (oldest_open() <= partition().window().now() - opt_.window) report(label, oldest_open());
    settle();
    return stats;
  }
  template <typename Label>
  void end_pass(Label&& label) {
    name_new();
    report(label);
  }

  // Runs over all frames so far again, block by block: first for the best partition, then for
  // confidence. Regularly calls `goes_on(fraction of the work done)`.
  template <typename Label>
  void finish(Label&& label, const std::function<bool(double)>& goes_on) {
    if (so_far_.n_seen == 0) return;
    SampledStats stats;
    sweep_.link_labels();
    if (partition_.is_shared()) sweep_.give(given_);
    std::vector<double> sure(has_confidence() ? so_far_.n_seen : 0, 1.0);
    const auto blocks = sweep_.blocks();
    const double overlap = sweep_.overlap();
    const std::size_t n_sweeps = has_confidence() ? 2 : 1;
    bool is_stopped = false;
    for (std::size_t s = 0; s < n_sweeps && !is_stopped; ++s)
      for (std::size_t b = 0; b < blocks.size() && !is_stopped; ++b) {
        const double n_done = static_cast<double>(s * blocks.size() + b);
        const double n_all = static_cast<double>(n_sweeps * blocks.size());
        const auto go_on = [&](double share) { return goes_on((n_done + share) / n_all); };
        auto part = sweep_.take(partition_, blocks[b]);
        if (s == 0 && !is_draw_) part.partition.keep_last_markers();
        const double moves = (s == 0 ? opt_.moves : opt_.confidence) / overlap;
        Split split = split_up(part.partition, part.ambiguous, {}, stats);
        const auto weights = weights_of(split.groups, [](const Group& g) { return g.n_open; });
        double all = 0;
        for (const double weight : weights) all += weight;
        Watch watch(all * moves * opt_.n_chains, go_on);
        const Budgets budgets(weights, moves, &watch);
        const std::uint64_t seed = seed_of(2 + n_sweeps * b + s);
        if (s == 0) {
          chains_.search(part.partition, split.groups, budgets, seed, stats.chain);
          sweep_.put_back(blocks[b], part);
        } else {
          const auto shares =
              chains_.sample(part.partition, split.groups, budgets, seed, stats.chain);
          sweep_.keep_states(blocks[b], part);
          take_shares(blocks[b], part, shares, sure);
        }
        is_stopped = watch.is_stopped();
      }
    stats.n_confirmed = sweep_.read_labels();
    total_.add(stats);
    for (std::int64_t i = 0; i < so_far_.n_seen; ++i) {
      // The confidence of a track's first detection is that of the link to the next one.
      const bool is_first = sweep_.before(i) < 0 && sweep_.after(i) >= 0;
      label(i, sweep_.labels()[i], has_confidence() ? sure[is_first ? sweep_.after(i) : i] : 0);
    }
  }

  // Sets labels whose links the coming frames start from, if the model allows them.
  // With `shared`, the labels are also those of its markers.
  void start_from(std::vector<std::int64_t> labels, std::shared_ptr<const SharedAcceleration> shared) {
    given_ = std::make_shared<const GivenLabels>(
        GivenLabels{so_far_.n_seen, std::move(labels), std::move(shared)});
    partition_.give(given_);
    start_.forget_given();
  }

  bool has_confidence() const { return opt_.confidence > 0; }
  const Progress& so_far() const { return so_far_; }
  SampledStats total() const { return total_; }
  const Partition<Filter>& partition() const { return partition_; }

  const MotionModel& motion() const { return partition().motion(); }
  std::int64_t n_ids() const { return is_finished() ? total_.n_confirmed : next_id_ + n_named_; }
  // The tracks as they would be if all frames were settled now.
  LiveTracks<> live() const {
    const Partition<Filter>& p = partition();
    LiveTracks<> live(p.motion(), p.model(), {});
    live.next_id = n_ids();
    for (const std::int32_t k : p.tracks().items()) {
      const std::int32_t i = p.last(k);
      const std::int64_t number = p.window()[i].number;
      if (is_finished() && sweep_.after(number) >= 0) continue;  // continued by another detection
      LiveTrack<NoMore>& track = live.tracks.emplace_back();
      track.id = is_finished() ? sweep_.labels()[number] : id_of(k);
      track.gap = static_cast<std::int32_t>(p.window().now() - p.window()[i].frame);
      track.score = p.score(i) + live.misses_gain(0, track.gap);
      track.state = state_now(i);
    }
    std::sort(live.tracks.begin(), live.tracks.end(),
              [](const auto& a, const auto& b) { return a.id < b.id; });
    return live;
  }

 private:
  // Whether the labels are those of the run over all frames so far.
  bool is_finished() const {
    return opt_.is_whole && static_cast<std::int64_t>(sweep_.labels().size()) == so_far_.n_seen;
  }

  SampledStats add(double time, const MotionStep& step, std::span<const Point> points) {
    const auto arrival = Clock::now();
    Partition<Filter>& p = partition_;
    p.add_frame(time, step, points, so_far_.n_seen);
    so_far_.add(time, points.size());
    SampledStats stats;
    start_.begin(p, ambiguous_, stats.chain, stats.n_candidates);
    if (opt_.is_whole) {
      sweep_.add_frame(time, step, points);
      ambiguous_.each_new([&](std::int32_t from, std::int32_t to) {
        sweep_.add_ambiguous(p.window()[from].number, p.window()[to].number);
      });
    }
    const Bonds sure = BondFinder<Filter>(p, opt_.bonds).find();
    stats.chain.n_sure = sure.n_sure;
    const auto allowed = [&](std::span<const Group> groups, double moves, double share) {
      return budgets(groups, moves, arrival, share);
    };
    // Where markers accelerate together, a whole capture is searched at the end alone: the chains of
    // a window do not know where the others will be.
    const bool is_searched_now = !opt_.is_whole || !p.is_shared();
    if (is_searched_now && (opt_.moves > 0 || has_confidence()))
      run_chains(sure.is_sure, allowed, 0, stats,
                 [&] { return has_confidence() && !opt_.is_whole; });
    stats.n_confirmed = p.tracks().size();
    stats.n_pending = p.free().size() + p.taken().size();
    total_.add(stats);
    return stats;
  }

  // Searches for the best partition, and then estimates confidence if `wants_confidence`.
  // `allowed(groups, moves, fraction of the time)` returns the budgets.
  template <typename Allowed, typename WantsConfidence>
  void run_chains(const std::vector<char>& is_sure, Allowed&& allowed, std::uint64_t phase,
            SampledStats& stats, WantsConfidence&& wants_confidence) {
    Split split = split_up(partition_, ambiguous_, is_sure, stats);
    chains_.search(partition_, split.groups,
                   allowed(split.groups, opt_.moves, has_confidence() ? 0.5 : 1), seed_of(phase),
                   stats.chain);
    if (!wants_confidence()) return;
    keep_shares(chains_.sample(partition_, split.groups, allowed(split.groups, opt_.confidence, 1),
                               seed_of(phase + 1), stats.chain));
  }

  // Stores the confidences of a block for the frames that are at least as far inside it as in any
  // other block.
  void take_shares(const typename CaptureSweep<Filter>::Block& block,
                   const typename CaptureSweep<Filter>::Part& part, const std::vector<double>& shares,
                   std::vector<double>& sure) const {
    const std::int64_t margin = (block.last + 1 - block.next) / 2;
    const Partition<Filter>& p = part.partition;
    for (std::int32_t i = 0; i < p.window().n_ids(); ++i) {
      const std::int64_t t = sweep_.frame_of(part.numbers[i]);
      if (t >= (block.is_first ? 0 : block.first + margin) && (block.is_last || t < block.next + margin))
        sure[part.numbers[i]] = shares[i];
    }
  }

  Split split_up(const Partition<Filter>& p, const AmbiguousLinks& ambiguous,
                 const std::vector<char>& is_sure, SampledStats& stats) {
    Splitter<Filter> splitter(p, opt_.split);
    Split wide = splitter.split(ambiguous, is_sure);
    chains_.list(p, wide.groups);
    const Split split = splitter.divide(std::move(wide));
    stats.n_groups += split.n_all;
    for (const Group& group : split.groups)
      stats.largest_group = std::max<std::int64_t>(
          stats.largest_group, static_cast<std::int64_t>(group.tracks.size() + group.free.size()));
    stats.chain.n_walked += static_cast<std::int64_t>(split.groups.size());
    stats.chain.n_cut += split.n_cut;
    return split;
  }

  template <typename Weight>
  static std::vector<double> weights_of(std::span<const Group> groups, Weight&& weight) {
    std::vector<double> weights;
    for (const Group& group : groups) weights.push_back(static_cast<double>(weight(group)));
    return weights;
  }
  // Budgets of a frame; the deadline applies to a fraction of the time allowed.
  Budgets budgets(std::span<const Group> groups, double moves, Clock::time_point arrival,
                  double share) const {
    const auto weights = weights_of(groups, [](const Group& group) {
      return std::max<std::int64_t>(group.n_new, static_cast<std::int64_t>(group.tracks.size()));
    });
    Budgets out(weights, moves);
    if (opt_.deadline > 0) {
      // Where markers accelerate together, groups are searched one after the other.
      const std::int32_t n_threads =
          partition().is_shared() ? std::min(opt_.n_threads, opt_.n_chains) : opt_.n_threads;
      out.end_at(after(arrival, opt_.deadline * share), weights, opt_.n_chains, n_threads);
    }
    return out;
  }
  std::uint64_t seed_of(std::uint64_t phase) const {
    return Random(Random(seed_ ^ static_cast<std::uint64_t>(so_far_.n_frames)).next() ^ phase).next();
  }

  // Averages the confidence of a link over the frames since it was made, because the chains of one
  // frame are short and each starts at the best partition. The average stays fixed once the
  // predecessor is settled.
  void keep_shares(const std::vector<double>& now) {
    const Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    shares_.resize(window.n_ids());
    for (std::int64_t t = oldest_open(); t <= window.now(); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int32_t k = p.track_of(i), before = k < 0 ? -2 : p.before(i);
        Share& kept = shares_[i];
        const bool is_settled = before >= 0 && p.place_of(i) <= p.track(k).n_frozen;
        if (is_settled && kept.before == before) continue;
        if (kept.before != before) kept = {0, 0, before};
        kept.sum += now[i];
        ++kept.n;
      }
  }

  std::int64_t oldest_open() const { return partition().frozen() + 1; }

  // Numbers the tracks without settled detections as they would be numbered if settled now.
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

  // Reports the labels of the open frames that have changed.
  template <typename Label>
  void report(Label&& label, std::int64_t last = std::numeric_limits<std::int64_t>::max()) {
    const Partition<Filter>& p = partition();
    const DetectionWindow& window = p.window();
    if (static_cast<std::int32_t>(reported_.size()) < window.n_ids())
      reported_.resize(window.n_ids());
    for (std::int64_t t = oldest_open(); t <= std::min(last, window.now()); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int32_t k = p.track_of(i);
        const Reported now{k < 0 ? -1 : id_of(k), confidence_of(i)};
        if (now == reported_[i]) continue;
        reported_[i] = now;
        if (opt_.is_whole) sweep_.set_label(window[i].number, now.id);
        label(window[i].number, now.id, now.confidence);
      }
  }
  // Probability that the link to the previous detection is right. For a first detection it is that
  // of the link to the next; for clutter, that the detection is in no track.
  double confidence_of(std::int32_t i) const {
    if (shares_.empty()) return 0;  // not requested, or not yet available
    const Partition<Filter>& p = partition();
    const bool is_first = p.track_of(i) >= 0 && p.place_of(i) == 0 && p.track(p.track_of(i)).n_gone == 0;
    const Share& all = shares_[is_first ? p.after(i) : i];
    return all.sum / all.n;
  }

  // Settles frames older than the window, and removes frames that no link can reach any more.
  void settle() {
    Partition<Filter>& p = partition_;
    const DetectionWindow& window = p.window();
    const std::int64_t settled = window.now() - opt_.window;
    if (settled < oldest_open()) return;
    p.freeze(settled);
    // Tracks with settled detections keep their numbers.
    for (const std::int32_t k : p.tracks().items())
      if (p.track(k).n_frozen > 0) next_id_ = std::max(next_id_, id_of(k) + 1);
    ambiguous_.keep(static_cast<std::size_t>(window.now() - settled));
    while (window.first() + window.max_gap() <= settled) {
      for (const std::int32_t i : window.frame(window.first()).ids) {
        if (i < static_cast<std::int32_t>(reported_.size())) reported_[i] = {};
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
  std::shared_ptr<const GivenLabels> given_;
  McmcOptions opt_;
  std::uint64_t seed_;
  FrameStart<Filter> start_;
  ParallelChains<Filter> chains_;
  bool is_draw_;
  AmbiguousLinks ambiguous_;
  // By detection of the window: the probability of its link, and the label and confidence last
  // reported.
  struct Share {
    double sum = 0;
    std::int32_t n = 0, before = -3;
  };
  std::vector<Share> shares_;
  struct Reported {
    std::int64_t id = -1;
    double confidence = -1;
    bool operator==(const Reported&) const = default;
  };
  std::vector<Reported> reported_;
  CaptureSweep<Filter> sweep_;
  std::int64_t next_id_ = 0, n_named_ = 0;
  SampledStats total_;
  Progress so_far_;
};

}  // namespace asterism
