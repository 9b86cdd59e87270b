// Remembers the gain of a link from the present state of a detection to another detection. A chain
// proposes the same links again and again, because few moves are accepted, and each gain takes a
// prediction.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace asterism {

class LinkGains {
 public:
  // A copy of a partition has stamps of its own.
  LinkGains() = default;
  LinkGains(const LinkGains&) {}
  LinkGains& operator=(const LinkGains&) {
    entries_.clear();
    return *this;
  }

  // The place of the gain of the link to detection j from the state with this stamp, NaN if the gain
  // is unknown. A key is used for one link only, but another key may later use the same place.
  double& of(std::int64_t stamp, std::int64_t version, std::int32_t j) {
    if (entries_.empty()) entries_.resize(std::size_t{1} << kBits);
    const auto hash = static_cast<std::uint64_t>(stamp) * 0x9e3779b97f4a7c15u +
                      static_cast<std::uint64_t>(j) * 0xd1342543de82ef95u;
    Entry& e = entries_[hash >> (64 - kBits)];
    if (e.stamp != stamp || e.version != version || e.detection != j)
      e = {stamp, version, std::numeric_limits<double>::quiet_NaN(), j};
    return e.gain;
  }

 private:
  static constexpr int kBits = 13;
  struct Entry {
    std::int64_t stamp = -1, version = -1;
    double gain = 0;
    std::int32_t detection = -1;
  };
  std::vector<Entry> entries_;
};

}  // namespace asterism
