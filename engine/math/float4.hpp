// Four single-precision numbers, computed with one instruction where the compiler supports vector
// types.
#pragma once

#include <array>

namespace asterism {

#if defined(__GNUC__)

using Float4 = float __attribute__((vector_size(16)));

inline Float4 minimum(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 maximum(Float4 a, Float4 b) { return a > b ? a : b; }

#else

struct alignas(16) Float4 {
  std::array<float, 4> v;
  float operator[](std::size_t k) const { return v[k]; }
  float& operator[](std::size_t k) { return v[k]; }
};

template <typename F>
Float4 each(Float4 a, Float4 b, F f) {
  return {{f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])}};
}
inline Float4 of(float x) { return {{x, x, x, x}}; }
inline Float4 operator-(Float4 a, float b) { return each(a, of(b), [](float p, float q) { return p - q; }); }
inline Float4 operator*(Float4 a, float b) { return each(a, of(b), [](float p, float q) { return p * q; }); }
inline Float4 operator+(Float4 a, float b) { return each(a, of(b), [](float p, float q) { return p + q; }); }
inline Float4 minimum(Float4 a, Float4 b) {
  return each(a, b, [](float p, float q) { return p < q ? p : q; });
}
inline Float4 maximum(Float4 a, Float4 b) {
  return each(a, b, [](float p, float q) { return p > q ? p : q; });
}

#endif

inline Float4 filled(float x) {
#if defined(__GNUC__)
  return Float4{x, x, x, x};
#else
  return of(x);
#endif
}

// Returns a mask in which bit k is set if a[k] ≤ b[k].
inline unsigned bits_not_above(Float4 a, Float4 b) {
  unsigned bits = 0;
  for (unsigned k = 0; k < 4; ++k) bits |= static_cast<unsigned>(a[k] <= b[k]) << k;
  return bits;
}

}  // namespace asterism
