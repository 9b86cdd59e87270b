// Finds stretches of frames in which two tracks have each other's marker, among all near pairs.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "confidence/exchanges.hpp"
#include "stitch/exchanged_pair.hpp"
#include "stitch/usual_distances.hpp"

namespace asterism {

// The distances are measured, and at least one track of each pair `is_examined`. The arguments are
// those of `ExchangedPair`.
inline std::vector<ExchangedStretch> stretches_of_pairs(const UsualDistances& all,
                                                        const MotionModel& m, const Timeline& line,
                                                        double p_detection, double noise,
                                                        ExchangeEvidence evidence,
                                                        std::span<const char> is_examined) {
  constexpr double kNear = 0.3;  // usual distance of tracks that are compared, metres
  std::vector<ExchangedStretch> found;
  std::vector<Exchange> exchanges;  // by tracks
  if (evidence == ExchangeEvidence::motion) {
    ExchangeSearch search(m, line, p_detection);
    for (std::int32_t k = 0; k < all.n_tracks(); ++k)
      if (all.is_long(k))
        search.add(all.points(k), all.frames(k));
      else
        search.add({}, {});
    exchanges = search.find(1);
    std::ranges::stable_sort(exchanges, {}, &Exchange::track);
  }
  ExchangedPair pair(all, m, line, p_detection, noise, evidence);
  for (std::int32_t a = 0; a < all.n_tracks(); ++a)
    for (std::int32_t b = a + 1; b < all.n_tracks(); ++b)
      if ((is_examined[a] || is_examined[b]) && all.usual(a, b) < kNear) {
        const auto of = std::ranges::equal_range(exchanges, std::array{a, b}, {}, &Exchange::track);
        pair.find(a, b, of, found);
      }
  return found;
}

}  // namespace asterism
