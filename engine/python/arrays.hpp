// Conversion between NumPy arrays and C++ ranges.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

namespace nb = nanobind;

namespace asterism {

template <typename T>
using In = nb::ndarray<const T, nb::numpy, nb::c_contig, nb::device::cpu>;
template <typename T>
using Out = nb::ndarray<nb::numpy, T>;

template <typename T>
struct Owned {
  std::unique_ptr<T[]> data;
  explicit Owned(std::size_t n) : data(new T[n]()) {}
  Out<T> give(std::initializer_list<std::size_t> shape) {
    T* raw = data.release();
    nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return Out<T>(raw, shape, owner);
  }
};

// An array with the given shape and the values of a range. `project` is applied to each value of a
// one-dimensional array.
template <typename T, typename Range>
Out<T> array_of(const Range& values, std::initializer_list<std::size_t> shape) {
  Owned<T> out(std::size(values));
  std::transform(std::begin(values), std::end(values), out.data.get(),
                 [](const auto& x) { return static_cast<T>(x); });
  return out.give(shape);
}
template <typename T, typename Range, typename Project = std::identity>
Out<T> array_of(const Range& values, Project project = {}) {
  Owned<T> out(std::size(values));
  std::transform(std::begin(values), std::end(values), out.data.get(),
                 [&](const auto& x) { return static_cast<T>(std::invoke(project, x)); });
  return out.give({std::size(values)});
}

// All values of an array in row-major order.
template <typename T>
std::span<const T> flat(const In<T>& array) {
  return {array.data(), array.size()};
}

// The same values, of another type.
template <typename To, typename From>
std::vector<To> values_as(const In<From>& array) {
  return {array.data(), array.data() + array.size()};
}

inline void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

inline void require_within(std::span<const std::int32_t> values, std::int32_t least, std::int32_t n,
                           const char* what) {
  for (const std::int32_t x : values) require(x >= least && x < n, what);
}

// Checks that offsets start at 0 or above, increase, and end within n values.
inline void require_offsets(std::span<const std::int64_t> offsets, std::size_t n, const char* what) {
  require(!offsets.empty() && offsets.front() >= 0 && std::ranges::is_sorted(offsets) &&
              offsets.back() <= static_cast<std::int64_t>(n),
          what);
}

}  // namespace asterism
