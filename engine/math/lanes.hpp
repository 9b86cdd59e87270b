// Four double-precision numbers on which every operation acts alike.
//
// Compilers with vector types make two or four instructions of an operation, depending on the
// processor for which the calling function is compiled; all functions here are therefore inlined.
// The results do not depend on the processor, because nothing is contracted or reordered.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace asterism {

inline constexpr int kLanes = 4;

#if defined(__GNUC__)

#define ASTERISM_INLINED [[gnu::always_inline]] inline
#define ASTERISM_INLINED_LAMBDA __attribute__((always_inline))

// Vectors on the heap need not be aligned to their whole size.
using LaneValues = double __attribute__((vector_size(32), aligned(16)));
using LaneBits = std::uint64_t __attribute__((vector_size(32), aligned(16)));

#else

#define ASTERISM_INLINED inline
#define ASTERISM_INLINED_LAMBDA

template <typename T>
struct LaneArray {
  std::array<T, kLanes> v{};
  T operator[](int i) const { return v[i]; }
  T& operator[](int i) { return v[i]; }
};
using LaneValues = LaneArray<double>;

#endif

struct Lanes {
  LaneValues at{};

  Lanes() = default;
  ASTERISM_INLINED Lanes(double value) {  // broadcasts a number to all lanes
    for (int i = 0; i < kLanes; ++i) at[i] = value;
  }
};

#if defined(__GNUC__)

ASTERISM_INLINED Lanes lanes_of(LaneValues values) {
  Lanes lanes;
  lanes.at = values;
  return lanes;
}
ASTERISM_INLINED Lanes operator+(const Lanes& a, const Lanes& b) { return lanes_of(a.at + b.at); }
ASTERISM_INLINED Lanes operator-(const Lanes& a, const Lanes& b) { return lanes_of(a.at - b.at); }
ASTERISM_INLINED Lanes operator*(const Lanes& a, const Lanes& b) { return lanes_of(a.at * b.at); }
ASTERISM_INLINED Lanes operator/(const Lanes& a, const Lanes& b) { return lanes_of(a.at / b.at); }
ASTERISM_INLINED Lanes minimum(const Lanes& a, const Lanes& b) {
  return lanes_of(a.at < b.at ? a.at : b.at);
}
ASTERISM_INLINED Lanes maximum(const Lanes& a, const Lanes& b) {
  return lanes_of(a.at > b.at ? a.at : b.at);
}
// a where the condition is above 0, b elsewhere.
ASTERISM_INLINED Lanes where(const Lanes& condition, const Lanes& a, const Lanes& b) {
  return lanes_of(condition.at > 0.0 ? a.at : b.at);
}
// The numbers after `change` has changed their bits.
template <typename Change>
ASTERISM_INLINED Lanes with_bits(const Lanes& a, Change&& change) {
  auto bits = reinterpret_cast<LaneBits>(a.at);
  change(bits);
  return lanes_of(reinterpret_cast<LaneValues>(bits));
}

#else

template <typename Each>
Lanes by_lane(Each&& each) {
  Lanes result;
  for (int i = 0; i < kLanes; ++i) result.at[i] = each(i);
  return result;
}
inline Lanes operator+(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] + b.at[i]; });
}
inline Lanes operator-(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] - b.at[i]; });
}
inline Lanes operator*(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] * b.at[i]; });
}
inline Lanes operator/(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] / b.at[i]; });
}
inline Lanes minimum(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] < b.at[i] ? a.at[i] : b.at[i]; });
}
inline Lanes maximum(const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return a.at[i] > b.at[i] ? a.at[i] : b.at[i]; });
}
inline Lanes where(const Lanes& condition, const Lanes& a, const Lanes& b) {
  return by_lane([&](int i) { return condition.at[i] > 0 ? a.at[i] : b.at[i]; });
}
template <typename Change>
Lanes with_bits(const Lanes& a, Change&& change) {
  return by_lane([&](int i) {
    auto bits = std::bit_cast<std::uint64_t>(a.at[i]);
    change(bits);
    return std::bit_cast<double>(bits);
  });
}

#endif

ASTERISM_INLINED Lanes& operator+=(Lanes& a, const Lanes& b) { return a = a + b; }
ASTERISM_INLINED Lanes operator-(const Lanes& a) { return Lanes(0.0) - a; }
ASTERISM_INLINED Lanes absolute(const Lanes& a) { return maximum(a, -a); }
ASTERISM_INLINED Lanes square_root(const Lanes& a) {
  Lanes result;
  for (int i = 0; i < kLanes; ++i) result.at[i] = std::sqrt(a.at[i]);
  return result;
}

// exp(x) for x ≤ 0, to a relative accuracy of 2e-16: 2^k times the Taylor series of the remainder,
// which is at most ½ log 2.
ASTERISM_INLINED Lanes exp_of_negative(const Lanes& x) {
  constexpr double kRound = 6755399441055744.0;  // 1.5 · 2^52: adding it rounds to an integer
  constexpr double kLn2High = 0x1.62e42fefap-1, kLn2Low = 0x1.cf79abc9e3b39803p-40;
  const Lanes y = maximum(x, -700.0);
  const Lanes rounded = y * std::numbers::log2e + kRound;
  const Lanes k = rounded - kRound;
  const Lanes r = (y - k * kLn2High) - k * kLn2Low;
  Lanes sum = 1.0 / 6227020800;
  for (const double factorial : {479001600.0, 39916800.0, 3628800.0, 362880.0, 40320.0, 5040.0,
                                 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0})
    sum = sum * r + 1 / factorial;
  return sum * with_bits(rounded, [](auto& bits) ASTERISM_INLINED_LAMBDA {
    bits = (bits + 1023) << 52;
  });
}

// The logarithm of a product of many numbers above 0, with one logarithm at the end.
class LogProduct {
 public:
  ASTERISM_INLINED void multiply(const Lanes& x) {
    const Lanes product = mantissa_ * x;
    // Numbers that are not finite and normal have no mantissa and exponent to part.
    invalid_ = invalid_ + (product - product);
    exponent_ = exponent_ + (with_bits(product, [](auto& bits) ASTERISM_INLINED_LAMBDA {
      bits = (bits >> 52) | kTwo52;
    }) - kOne);
    mantissa_ = with_bits(product, [](auto& bits) ASTERISM_INLINED_LAMBDA {
      bits = (bits & kMantissa) | kExponentOf1;
    });
  }
  double log(int lane) const {
    return std::log(mantissa_.at[lane]) + std::numbers::ln2 * exponent_.at[lane] + invalid_.at[lane];
  }

 private:
  static constexpr std::uint64_t kMantissa = 0x000fffffffffffff, kExponentOf1 = 0x3ff0000000000000;
  // The bits of 2^52, whose last bits count ones, and that number with an exponent of 0 in them.
  static constexpr std::uint64_t kTwo52 = 0x4330000000000000;
  static constexpr double kOne = 4503599627370496.0 + 1023;

  Lanes mantissa_ = 1.0, exponent_, invalid_;
};

}  // namespace asterism
