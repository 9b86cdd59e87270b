// Finds alternatives of links: pairs of tracks whose later parts may have been exchanged, with the
// log-likelihood ratio of each alternative by the motion model.
//
// A cut at frame t parts every track into a head, the detections before t, and a tail, the
// detections from t on. The ratio compares
//
//   exchanged   head a, tail b  and  head b, tail a
//   kept        head a, tail a  and  head b, tail b
//
// over the last detections of the heads and the first ones of the tails. Track b may have ended
// shortly before t, and then continues with the tail of a; or it begins at t or shortly after, and
// then continues a.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "filter/imm.hpp"
#include "filter/track_filter.hpp"

namespace asterism {

struct Exchange {
  std::int64_t frame = 0;      // first frame of the tails
  std::int32_t a = 0, b = 0;   // tracks, a < b
  double gain = 0;             // log-likelihood ratio of exchanged against kept
  bool is_mutual = false;      // whether both tracks have a head and a tail
};

class ExchangeSearch {
 public:
  ExchangeSearch(const MotionModel& m, const Timeline& line, double p_detection)
      : m_(m), line_(line), log_miss_(std::log1p(-p_detection)) {}

  // The tracks are given as points and rising frames of each, and must not change.
  void add(std::span<const Point> points, std::span<const std::int64_t> frames) {
    tracks_.push_back({points, frames, 0, 0, {}});
  }

  // Log-likelihood ratio of an exchange of the first two tracks at a frame; both have a head and a
  // tail there.
  double ratio(std::int64_t t) {
    for (Track& own : tracks_) {
      const auto at = std::ranges::lower_bound(own.frames, t);
      own.next = static_cast<std::size_t>(at - own.frames.begin());
    }
    Track &a = tracks_[0], &b = tracks_[1];
    return tail(a, b) + tail(b, a) - tail(a, a) - tail(b, b);
  }

  std::vector<Exchange> find() {
    const auto n_frames = static_cast<std::int64_t>(line_.times.size());
    std::vector<std::vector<std::int32_t>> opens(n_frames);
    for (std::size_t k = 0; k < tracks_.size(); ++k)
      if (!tracks_[k].frames.empty())
        opens[std::max<std::int64_t>(0, tracks_[k].frames[0] - kNear)].push_back(
            static_cast<std::int32_t>(k));
    std::vector<std::int32_t> open;
    std::vector<Exchange> found;
    for (std::int64_t t = 0; t < n_frames; ++t) {
      open.insert(open.end(), opens[t].begin(), opens[t].end());
      std::erase_if(open, [&](std::int32_t k) {
        Track& own = tracks_[k];
        while (own.next < own.frames.size() && own.frames[own.next] < t) ++own.next;
        return !own.has_tail() && own.frames.back() < t - kNear;
      });
      compare(t, open, found);
    }
    return found;
  }

 private:
  static constexpr std::size_t kHead = 6, kTail = 4;  // detections that are compared
  static constexpr std::int64_t kNear = 10;  // frames within which a track ends or begins
  static constexpr double kMinGain = -4;
  // Largest squared deviation of another tail from straight motion, in variances of the model and
  // relative to the deviation of the own tail.
  static constexpr double kFar = 100, kTimes = 4;

  struct Track {
    std::span<const Point> points;
    std::span<const std::int64_t> frames;
    std::size_t next = 0;    // index of the first detection of the tail
    std::size_t stated = 0;  // value of `next` to which `head` belongs
    MotionState head;        // after the detection before `next`

    bool has_head() const { return next > 0; }
    bool has_tail() const { return next < frames.size(); }
  };
  // An open track at the frame of a cut, with its head in straight motion.
  struct Open {
    std::int32_t track = 0;
    bool arrives = false;  // whether the tail begins in this frame
    Point at{}, velocity{};  // of the head, per frame
    Point tail{};            // first detection of the tail
    std::int64_t frame = 0, tail_frame = 0;
    bool has_head = false, has_tail = false;
    double reach2 = 0;  // largest squared deviation at which another tail is compared
    double x = 0;       // of the head in the frame of the cut
    double tail_x = 0;  // of the tail in that frame

    // Whether the search along x compares this head with the tail of another track.
    bool reaches(const Open& other) const {
      const double reach = std::sqrt(reach2);
      return other.tail_x >= x - reach && other.tail_x <= x + reach;
    }
  };

  void compare(std::int64_t t, std::span<const std::int32_t> open, std::vector<Exchange>& found) {
    const double typical = 6 * m_.axis.r + middle_noise(t);
    open_.clear();
    by_x_.clear();
    late_.clear();
    for (const std::int32_t k : open) {
      const Track& own = tracks_[k];
      Open& o = open_.emplace_back();
      o.track = k;
      o.has_head = own.has_head();
      o.has_tail = own.has_tail();
      if (o.has_tail) {
        o.tail = own.points[own.next];
        o.tail_frame = own.frames[own.next];
        o.arrives = o.tail_frame == t;
      }
      if (o.has_head) {
        o.at = own.points[own.next - 1];
        o.frame = own.frames[own.next - 1];
        if (own.next > 1) {
          const auto n = static_cast<double>(o.frame - own.frames[own.next - 2]);
          for (int d = 0; d < m_.axis.D; ++d)
            o.velocity[d] = (o.at[d] - own.points[own.next - 2][d]) / n;
        }
        o.reach2 = std::max(kFar * typical, o.has_tail ? kTimes * deviation(o, o) : 0);
        o.x = o.at[0] + static_cast<double>(t - o.frame) * o.velocity[0];
      }
      const auto i = static_cast<std::int32_t>(open_.size()) - 1;
      if (o.has_tail && (o.arrives || o.has_head))
        by_x_.emplace_back(o.tail_x = place_along_x(o, t), i);
      else if (o.has_tail)
        late_.push_back(i);
    }
    std::ranges::sort(by_x_);
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(open_.size()); ++i) {
      const Open& one = open_[i];
      if (!one.has_head) continue;
      const double reach = std::sqrt(one.reach2);
      for (auto at = std::ranges::lower_bound(by_x_, std::pair(one.x - reach, std::int32_t{0}));
           at != by_x_.end() && at->first <= one.x + reach; ++at)
        if (at->second != i) compare(t, i, at->second, found);
      for (const std::int32_t j : late_)
        if (j != i) compare(t, i, j, found);
    }
  }
  // Compares two tracks, of which the first has a head and the second has a tail.
  void compare(std::int64_t t, std::int32_t i, std::int32_t j, std::vector<Exchange>& found) {
    const Open &one = open_[i], &other = open_[j];
    const bool is_mutual = one.has_tail && other.has_head;
    const double reach2 = one.reach2 + (is_mutual ? other.reach2 : 0);
    double exchanged = deviation(one, other);
    if (exchanged > reach2) return;  // most pairs
    if (is_mutual && j < i && other.reaches(one)) return;  // compared already
    if (!one.has_tail && !other.has_head) return;  // no link is cut
    // A link is cut where its later detection is, or where another track begins.
    if (!other.arrives && !(one.arrives && one.has_tail)) return;
    if (is_mutual) exchanged += deviation(other, one);
    if (exchanged > reach2) return;
    Track &a = tracks_[one.track], &b = tracks_[other.track];
    double gain = tail(a, b);
    if (is_mutual) gain += tail(b, a);
    if (one.has_tail) gain -= tail(a, a);
    if (other.has_head) gain -= tail(b, b);
    if (gain >= kMinGain)
      found.push_back({t, std::min(one.track, other.track), std::max(one.track, other.track), gain,
                       is_mutual});
  }
  // Process noise of the position in the step to frame t, of the mode in the middle.
  double middle_noise(std::int64_t t) const {
    return line_.steps[line_.kind[t]].mode[m_.M / 2].Q[0];
  }
  // Where a track with a tail is in frame t, between its last and its next detection.
  static double place_along_x(const Open& o, std::int64_t t) {
    if (o.arrives) return o.tail[0];
    const auto before = static_cast<double>(t - o.frame);
    const auto all = static_cast<double>(o.tail_frame - o.frame);
    return o.at[0] + (o.tail[0] - o.at[0]) * before / all;
  }
  // Squared distance of the first detection of a tail from the straight motion of a head.
  double deviation(const Open& head, const Open& tail) const {
    const auto n = static_cast<double>(tail.tail_frame - head.frame);
    double sum = 0;
    for (int d = 0; d < m_.axis.D; ++d) {
      const double off = tail.tail[d] - head.at[d] - n * head.velocity[d];
      sum += off * off;
    }
    return sum;
  }

  const MotionState& head(Track& own) {
    if (own.stated == own.next) return own.head;
    const std::size_t first = own.next - std::min(own.next, kHead);
    own.head = begin_state(m_, own.points[first]);
    for (std::size_t j = first + 1; j < own.next; ++j)
      advance(own.head, own.frames[j - 1], own, j);
    own.stated = own.next;
    return own.head;
  }
  // Predicts from frame `last` to a detection and takes it. Returns its log likelihood.
  double advance(MotionState& state, std::int64_t last, const Track& to, std::size_t j) {
    for (std::int64_t t = last + 1; t <= to.frames[j]; ++t)
      predict(m_, line_.steps[line_.kind[t]], state);
    return update(m_, Prediction(m_, state), to.points[j], state);
  }
  // Log likelihood of the first detections of a tail after a head.
  double tail(Track& before, const Track& after) {
    MotionState state = head(before);
    std::int64_t last = before.frames[before.next - 1];
    double sum = log_miss_ * static_cast<double>(after.frames[after.next] - last - 1);
    const std::size_t end = std::min(after.frames.size(), after.next + kTail);
    for (std::size_t j = after.next; j < end; ++j) {
      sum += advance(state, last, after, j);
      last = after.frames[j];
    }
    return sum;
  }

  const MotionModel& m_;
  const Timeline& line_;
  double log_miss_;
  std::vector<Track> tracks_;
  std::vector<Open> open_;  // of the frame that is compared
  std::vector<std::pair<double, std::int32_t>> by_x_;  // tracks with a tail, by place
  std::vector<std::int32_t> late_;                     // tracks that begin later
};

}  // namespace asterism
