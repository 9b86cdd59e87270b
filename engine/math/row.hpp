// A row of n numbers that are computed together, with one instruction for two numbers where the
// compiler supports vector types. Every number is computed as it would be alone.
#pragma once

#include <array>

namespace asterism {

template <int n>
struct Row {
  std::array<double, n> v;

  double operator[](int i) const { return v[i]; }
  static Row filled(double x) {
    Row out;
    out.v.fill(x);
    return out;
  }
  static Row of(const double* x) {
    Row out;
    for (int i = 0; i < n; ++i) out.v[i] = x[i];
    return out;
  }
  void write(double* x) const {
    for (int i = 0; i < n; ++i) x[i] = v[i];
  }
  friend Row operator+(Row a, Row b) {
    for (int i = 0; i < n; ++i) a.v[i] += b.v[i];
    return a;
  }
  friend Row operator-(Row a, Row b) {
    for (int i = 0; i < n; ++i) a.v[i] -= b.v[i];
    return a;
  }
  friend Row operator*(double a, Row b) {
    for (int i = 0; i < n; ++i) b.v[i] *= a;
    return b;
  }
  friend Row operator/(Row a, double b) {
    for (int i = 0; i < n; ++i) a.v[i] /= b;
    return a;
  }
};

#if defined(__GNUC__)

template <>
struct Row<2> {
  using Two = double __attribute__((vector_size(16)));
  Two v;

  double operator[](int i) const { return v[i]; }
  static Row filled(double x) { return {Two{x, x}}; }
  static Row of(const double* x) { return {Two{x[0], x[1]}}; }
  void write(double* x) const {
    x[0] = v[0];
    x[1] = v[1];
  }
  friend Row operator+(Row a, Row b) { return {a.v + b.v}; }
  friend Row operator-(Row a, Row b) { return {a.v - b.v}; }
  friend Row operator*(double a, Row b) { return {Two{a, a} * b.v}; }
  friend Row operator/(Row a, double b) { return {a.v / Two{b, b}}; }
};

#endif

}  // namespace asterism
