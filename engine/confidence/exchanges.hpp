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
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "filter/imm.hpp"
#include "filter/track_filter.hpp"

namespace asterism {

struct Exchange {
  std::int64_t frame = 0;      // first frame of the tails
  std::array<std::int32_t, 2> track{};  // rising
  std::array<std::int64_t, 2> tail{};   // index of the first detection of the tail in each track
  double gain = 0;             // log-likelihood ratio of exchanged against kept
};

class ExchangeSearch {
 public:
  ExchangeSearch(const MotionModel& m, const Timeline& line, double p_detection)
      : m_(m), line_(line), log_miss_(std::log1p(-p_detection)), peak_(highest_density()) {}

  // The tracks are given as points and rising frames of each, and must not change.
  void add(std::span<const Point> points, std::span<const std::int64_t> frames) {
    tracks_.push_back({points, frames});
  }

  // Log-likelihood ratio of an exchange of the first two tracks at a frame; both have a head and a
  // tail there.
  double ratio(std::int64_t t) const {
    Piece piece(*this);
    piece.move_to(t, std::array<std::int32_t, 2>{0, 1});
    return piece.tail(0, 1) + piece.tail(1, 0) - piece.tail(0, 0) - piece.tail(1, 1);
  }

  // Exchanges by rising frame. Pieces of time are searched in parallel.
  std::vector<Exchange> find(std::int32_t n_threads) const {
    const auto n_frames = static_cast<std::int64_t>(line_.times.size());
    const std::int64_t n_pieces = n_threads > 1 ? std::min(n_frames, kPieces * n_threads) : 1;
    std::vector<std::int32_t> order;  // by the frame from which each track is compared
    for (std::size_t k = 0; k < tracks_.size(); ++k)
      if (!tracks_[k].frames.empty()) order.push_back(static_cast<std::int32_t>(k));
    std::ranges::stable_sort(order, {}, [&](std::int32_t k) { return opens(k); });
    std::vector<Piece> workers(std::min<std::int64_t>(n_pieces, n_threads), Piece(*this));
    std::vector<std::vector<Exchange>> found(n_pieces);
    in_parallel(n_pieces, n_threads, [&](std::int32_t worker, std::int64_t p) {
      workers[worker].find(p * n_frames / n_pieces, (p + 1) * n_frames / n_pieces, order, found[p]);
    });
    std::vector<Exchange> all;
    for (const auto& each : found) all.insert(all.end(), each.begin(), each.end());
    return all;
  }

 private:
  static constexpr std::size_t kHead = 6, kTail = 4;  // detections that are compared
  static constexpr std::int64_t kNear = 10;  // frames within which a track ends or begins
  static constexpr std::int64_t kPieces = 4;  // of each thread; the result does not depend on it
  static constexpr double kMinGain = -4;
  // Log-likelihood ratio that rounding cannot reach.
  static constexpr double kRounding = 1e-3;
  // Largest squared deviation of another tail from straight motion, in variances of the model and
  // relative to the deviation of the own tail.
  static constexpr double kFar = 100, kTimes = 4;
  static constexpr double kNone = -std::numeric_limits<double>::infinity();

  struct Track {
    std::span<const Point> points;
    std::span<const std::int64_t> frames;
  };
  // A track at the frame of a cut.
  struct Cursor {
    std::span<const Point> points;
    std::span<const std::int64_t> frames;
    std::size_t next = 0;  // index of the first detection of the tail

    bool has_head() const { return next > 0; }
    bool has_tail() const { return next < frames.size(); }
    std::size_t tail_end() const { return std::min(frames.size(), next + kTail); }
    void move_to(std::int64_t t) {
      while (next < frames.size() && frames[next] < t) ++next;
    }
  };
  // What is computed of a track at a cut where it is first needed.
  struct Filtered {
    std::size_t head_at = 0, kept_at = 0;  // values of `next` to which these belong
    MotionState head;  // after the last detection of the head
    double kept = 0;   // log likelihood of the own tail after the head
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
  // The tails at the frame of a cut, each property in an array of its own: most are only compared
  // with a head by their deviation.
  struct Tails {
    std::array<std::vector<double>, kMaxAxes> at;
    std::vector<double> frame, reach2;
    std::vector<double> excess;  // squared deviation from a head, less the largest one
    std::vector<std::int32_t> open;

    void resize(std::size_t n) {
      for (auto& axis : at) axis.resize(n);
      for (auto* each : {&frame, &reach2, &excess}) each->resize(n);
      open.resize(n);
    }
    void set(std::size_t k, const Open& o, std::int32_t i) {
      for (int d = 0; d < kMaxAxes; ++d) at[d][k] = o.tail[d];
      frame[k] = static_cast<double>(o.tail_frame);
      reach2[k] = o.reach2;
      open[k] = i;
    }
    void compare(const Open& head, std::size_t from, std::size_t to) {
      // Copies, which nothing that is written can change: so the compiler vectorises the loop.
      const double shared = head.has_tail ? 1 : 0, since = static_cast<double>(head.frame);
      const double reach_of_head = head.reach2;
      const auto [x0, y0, z0] = static_cast<std::array<double, kMaxAxes>>(head.at);
      const auto [vx, vy, vz] = static_cast<std::array<double, kMaxAxes>>(head.velocity);
      const double *x = at[0].data(), *y = at[1].data(), *z = at[2].data(), *f = frame.data(),
                   *r = reach2.data();
      double* out = excess.data();
      for (std::size_t k = from; k < to; ++k) {
        const double n = f[k] - since;
        const double dx = x[k] - x0 - n * vx, dy = y[k] - y0 - n * vy, dz = z[k] - z0 - n * vz;
        out[k] = dx * dx + dy * dy + dz * dz - (reach_of_head + shared * r[k]);
      }
    }
  };

  // The search in a piece of time, with its own places in the tracks.
  struct Piece {
    explicit Piece(const ExchangeSearch& all) : s(all) {
      for (const Track& own : s.tracks_) cursors.push_back({own.points, own.frames});
      filtered.resize(cursors.size());
    }

    template <typename Tracks>
    void move_to(std::int64_t t, const Tracks& tracks) {
      for (const std::int32_t k : tracks) {
        const auto at = std::ranges::lower_bound(cursors[k].frames, t);
        cursors[k].next = static_cast<std::size_t>(at - cursors[k].frames.begin());
      }
    }
    void find(std::int64_t begin, std::int64_t end, std::span<const std::int32_t> order,
              std::vector<Exchange>& found) {
      auto coming = order.begin();
      open.clear();
      for (std::int64_t t = begin; t < end; ++t) {
        const auto n_before = static_cast<std::ptrdiff_t>(open.size());
        for (; coming != order.end() && s.opens(*coming) <= t; ++coming)
          if (s.tracks_[*coming].frames.back() >= t - kNear) open.push_back(*coming);
        move_to(t, std::span(open).subspan(n_before));
        std::erase_if(open, [&](std::int32_t k) {
          cursors[k].move_to(t);
          return !cursors[k].has_tail() && cursors[k].frames.back() < t - kNear;
        });
        compare(t, found);
      }
    }
    void compare(std::int64_t t, std::vector<Exchange>& found) {
      const double typical = 6 * s.m_.axis.r + s.middle_noise(t);
      opened.clear();
      by_x.clear();
      late.clear();
      for (const std::int32_t k : open) {
        const Cursor& own = cursors[k];
        Open& o = opened.emplace_back();
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
            for (int d = 0; d < s.m_.axis.D; ++d)
              o.velocity[d] = (o.at[d] - own.points[own.next - 2][d]) / n;
          }
          o.reach2 = std::max(kFar * typical, o.has_tail ? kTimes * s.deviation(o, o) : 0);
          o.x = o.at[0] + static_cast<double>(t - o.frame) * o.velocity[0];
        }
        const auto i = static_cast<std::int32_t>(opened.size()) - 1;
        if (o.has_tail && (o.arrives || o.has_head))
          by_x.emplace_back(o.tail_x = place_along_x(o, t), i);
        else if (o.has_tail)
          late.push_back(i);
      }
      std::ranges::sort(by_x);
      tails.resize(by_x.size() + late.size());
      for (std::size_t k = 0; k < by_x.size(); ++k)
        tails.set(k, opened[by_x[k].second], by_x[k].second);
      for (std::size_t k = 0; k < late.size(); ++k)
        tails.set(by_x.size() + k, opened[late[k]], late[k]);
      for (std::int32_t i = 0; i < static_cast<std::int32_t>(opened.size()); ++i) {
        const Open& one = opened[i];
        if (!one.has_head) continue;
        const double reach = std::sqrt(one.reach2);
        const double low = one.x - reach, high = one.x + reach;
        compare(t, i, tails_until([&](double x) { return x < low; }),
                tails_until([&](double x) { return x <= high; }), found);
        // A tail that begins later is compared only where the own link is cut.
        if (one.arrives) compare(t, i, by_x.size(), tails.open.size(), found);
      }
    }
    // Number of tails in `by_x` up to the last one for which a property of their place holds, which
    // holds for all before. The search has no branch that depends on the places: the processor
    // would predict every second one wrongly.
    template <typename Holds>
    std::size_t tails_until(Holds&& holds) const {
      std::size_t at = 0;
      for (std::size_t n = by_x.size(); n > 0;) {
        const std::size_t half = n - n / 2;
        at += holds(by_x[at + half - 1].first) * half;
        n -= half;
      }
      return at;
    }
    // Compares the head of a track with tails.
    void compare(std::int64_t t, std::int32_t i, std::size_t from, std::size_t to,
                 std::vector<Exchange>& found) {
      tails.compare(opened[i], from, to);
      for (std::size_t k = from; k < to; ++k)
        if (!(tails.excess[k] > 0) && tails.open[k] != i) compare(t, i, tails.open[k], found);
    }
    // Compares two tracks, of which the second has a tail near the head of the first.
    void compare(std::int64_t t, std::int32_t i, std::int32_t j, std::vector<Exchange>& found) {
      const Open &one = opened[i], &other = opened[j];
      const bool is_mutual = one.has_tail && other.has_head;
      if (is_mutual && j < i && other.reaches(one)) return;  // compared already
      if (!one.has_tail && !other.has_head) return;  // no link is cut
      // A link is cut where its later detection is, or where another track begins.
      if (!other.arrives && !one.arrives) return;
      if (is_mutual && s.deviation(one, other) + s.deviation(other, one) > one.reach2 + other.reach2)
        return;
      const std::int32_t a = one.track, b = other.track;
      const double kept_a = one.has_tail ? kept(a) : 0, kept_b = other.has_head ? kept(b) : 0;
      // Least log likelihood of what is exchanged; most pairs are far below.
      const double min = kMinGain - kRounding + kept_a + kept_b;
      double gain = tail(a, b, is_mutual ? min - s.highest(cursors[a]) : min);
      if (is_mutual && gain != kNone) gain += tail(b, a, min - gain);
      gain = gain - kept_a - kept_b;
      if (!(gain >= kMinGain)) return;
      Exchange& made = found.emplace_back(Exchange{t, {std::min(a, b), std::max(a, b)}, {}, gain});
      for (const int side : {0, 1})
        made.tail[side] = static_cast<std::int64_t>(cursors[made.track[side]].next);
    }

    const MotionState& head(std::int32_t k) {
      const Cursor& own = cursors[k];
      Filtered& known = filtered[k];
      if (known.head_at == own.next) return known.head;
      const std::size_t first = own.next - std::min(own.next, kHead);
      known.head = begin_state(s.m_, own.points[first]);
      for (std::size_t j = first + 1; j < own.next; ++j)
        s.advance(known.head, own.frames[j - 1], own, j);
      known.head_at = own.next;
      return known.head;
    }
    // Log likelihood of the first detections of the own tail after the head.
    double kept(std::int32_t k) {
      Filtered& known = filtered[k];
      if (known.kept_at != cursors[k].next) known.kept = tail(k, k);
      known.kept_at = cursors[k].next;
      return known.kept;
    }
    // Log likelihood of the first detections of the tail of track b after the head of track a; -inf
    // as soon as it is below a minimum whatever follows.
    double tail(std::int32_t a, std::int32_t b, double min = kNone) {
      const Cursor &before = cursors[a], &after = cursors[b];
      MotionState state = head(a);
      std::int64_t last = before.frames[before.next - 1];
      double sum = s.log_miss_ * static_cast<double>(after.frames[after.next] - last - 1);
      const std::size_t end = after.tail_end();
      for (std::size_t j = after.next; j < end; ++j) {
        sum += s.advance(state, last, after, j);
        if (sum + static_cast<double>(end - j - 1) * s.peak_ < min) return kNone;
        last = after.frames[j];
      }
      return sum;
    }

    const ExchangeSearch& s;
    std::vector<Cursor> cursors;
    std::vector<Filtered> filtered;
    std::vector<std::int32_t> open;
    // Of the frame that is compared.
    std::vector<Open> opened;
    std::vector<std::pair<double, std::int32_t>> by_x;  // tracks with a tail, by place
    std::vector<std::int32_t> late;                     // tracks that begin later
    Tails tails;  // those of `by_x`, then those of `late`
  };

  // The frame from which a track is compared.
  std::int64_t opens(std::int32_t k) const {
    return std::max<std::int64_t>(0, tracks_[k].frames[0] - kNear);
  }
  // Process noise of the position in the step to frame t, of the mode in the middle.
  double middle_noise(std::int64_t t) const {
    return line_.steps[line_.kind[t]].mode[m_.M / 2].Q[0];
  }
  // Log density that no detection exceeds, because every prediction holds the noise of a step.
  double highest_density() const {
    double least = std::numeric_limits<double>::infinity();
    for (const MotionStep& step : line_.steps)
      for (int b = 0; b < m_.M; ++b) {
        AxisState noise;
        noise.P = step.mode[b].Q;
        least = std::min(least, innovation_variance(m_.axis, noise));
      }
    return log_density(m_.axis.D, least, 0);
  }
  // Largest log likelihood of a tail.
  double highest(const Cursor& own) const {
    return static_cast<double>(own.tail_end() - own.next) * peak_;
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
  // Predicts from frame `last` to a detection and takes it. Returns its log likelihood.
  double advance(MotionState& state, std::int64_t last, const Cursor& to, std::size_t j) const {
    for (std::int64_t t = last + 1; t <= to.frames[j]; ++t)
      predict(m_, line_.steps[line_.kind[t]], state);
    return update(m_, Prediction(m_, state), to.points[j], state);
  }

  const MotionModel& m_;
  const Timeline& line_;
  double log_miss_, peak_;
  std::vector<Track> tracks_;
};

}  // namespace asterism
