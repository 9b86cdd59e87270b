// Hidden markers carried by those that keep their distance from them: who these are, where the marker
// was among them when it was seen last, and how well they carried it lately while it was seen.
//
// The variance of a carried place (rigid/carried_place.hpp) is what bonds and geometry say, times how far off
// it was in the past: while a marker is seen, its neighbours are asked now and then to carry it here
// from kLag frames ago. It grows with the frames since the marker was seen. What bodies do that were
// never seen to move so far is not known: then it is wider by a share of how far they have moved.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <vector>

#include "base/scratch.hpp"
#include "rigid/carried_place.hpp"
#include "rigid/steady_bonds.hpp"
#include "rigid/tracklets.hpp"

namespace asterism {

// How a marker is carried now.
struct Carriage {
  CarriedPlace place;
  double nearest = 0;  // distance of the nearest neighbour
  std::int32_t n_neighbours = 0;
};

class BodyCarrier {
 public:
  // `r`: variance of a measured coordinate.
  BodyCarrier(int D, double r) : D_(D), r_(r), neighbours_(D, std::sqrt(r)) {}

  int n_axes() const { return D_; }
  double noise() const { return r_; }

  // The markers that are seen in the next frame, in order of their numbers.
  void see(std::span<const Seen> seen);
  // A marker that will not be seen again.
  void forget(std::int32_t marker);

  // Where a marker is that was not seen in the frames before, by where others are. False where none of
  // its neighbours is among them, or too little is known of it. Of the frames before this one, `n_open`
  // were not told to `see`: a marker that was there in the last that was may have gone since.
  bool carry(std::int32_t marker, const Places& now, Carriage& out, std::int64_t n_open = 0);

  // The steadiest bonds of a marker.
  std::span<const Bond> bonds(std::int32_t marker);
  // Pairs of markers that are bonded, each for one of them.
  std::int64_t n_bonds(std::int32_t marker) const;

 private:
  using Sighting = std::vector<Seen>;

  static constexpr std::size_t kRemembered = 16;  // neighbours of a hidden marker
  // Frames before the one in which a marker was seen last, which may show a ghost beside it.
  static constexpr std::array<std::size_t, 3> kAnchors{0, 4, 10};
  static constexpr std::size_t kLag = 12, kKept = kLag + 1;  // frames
  // A marker is asked about every so many frames; so many answers are remembered, and so many needed.
  static constexpr std::int64_t kJudgeEvery = 4, kMemory = 50, kLeastJudged = 3;
  static constexpr double kLeastOff = 0.02;  // κ is no less
  // Bodies that move more than so many times what they used to bend by a share of what is beyond that.
  static constexpr double kUsual = 2, kUnknown = 0.05;

  // Of the last kMemory values.
  struct RecentMean {
    std::int64_t n = 0;
    double value = 0;
    void add(double x) { value += (x - value) / static_cast<double>(std::min(++n, kMemory)); }
  };
  // Of a marker that was carried kLag frames to where it was seen: how far off that was along an axis,
  // squared; the part of this that bonds and geometry expected; how far off it would have been at its
  // offset from the steadiest neighbour; and how far it had moved, squared.
  struct Trust {
    RecentMean error, expected, shifted, moved;
  };

  // From the frame with that number, counted from 1.
  struct Remembered : Anchor {
    std::int64_t frame = 0;
  };
  struct Hidden {
    std::vector<Remembered> anchors;
    std::size_t n_back = 0;  // frames in which it was seen again
  };

  // Of a neighbour about where the body takes it: both were measured then and now, and bodies bend by
  // what the distance varied, and by what was not seen yet.
  double variance(const Bond& bond) const;

  // Whoever is back for a while is not hidden any more. Until then it may have been a ghost that came, so
  // that what was remembered of the marker is kept.
  void welcome(std::int32_t marker);
  void hide(std::int32_t marker);
  // Where a marker was among others in frames_[last], in which it was seen last, and before.
  void remember(std::int32_t marker, std::size_t last, std::vector<Remembered>& anchors);

  // Carries a marker from where it was by `s_.pairs`.
  Carriage way(const Point& then, const Trust& trust, double bent) const;
  // The way that is nearest to the others; of two, from where the marker was last.
  const Carriage& middle() const;

  void judge();

  struct Memory {
    std::vector<Bond> steady;
    std::vector<RigidPair> pairs;
    std::vector<Carriage> ways;
    std::vector<Remembered> anchors;
  };

  int D_;
  double r_;
  std::int64_t n_frames_ = 0;
  Neighbours neighbours_;
  std::deque<Sighting> frames_;
  std::map<std::int32_t, Hidden> hidden_;
  std::map<std::int32_t, Trust> trust_;
  Fresh<Memory> s_;
};

}  // namespace asterism
