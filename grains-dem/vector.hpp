// Vectors of two or three components, and spins: one component in the plane, three in space.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace estuary::grains {

template <int D>
using Vector = std::array<double, static_cast<std::size_t>(D)>;

/// Components of a spin, a torque or a tangential spring.
template <int D>
inline constexpr int spin_components = D == 2 ? 1 : 3;

template <int D>
using Spin = std::array<double, static_cast<std::size_t>(spin_components<D>)>;

template <std::size_t N>
inline std::array<double, N> operator+(const std::array<double, N>& a, const std::array<double, N>& b) {
  std::array<double, N> r;
  for (std::size_t c = 0; c < N; ++c) r[c] = a[c] + b[c];
  return r;
}
template <std::size_t N>
inline std::array<double, N> operator-(const std::array<double, N>& a, const std::array<double, N>& b) {
  std::array<double, N> r;
  for (std::size_t c = 0; c < N; ++c) r[c] = a[c] - b[c];
  return r;
}
template <std::size_t N>
inline std::array<double, N> operator*(double s, const std::array<double, N>& a) {
  std::array<double, N> r;
  for (std::size_t c = 0; c < N; ++c) r[c] = s * a[c];
  return r;
}
template <std::size_t N>
inline double dot(const std::array<double, N>& a, const std::array<double, N>& b) {
  double sum = a[0] * b[0];
  for (std::size_t c = 1; c < N; ++c) sum += a[c] * b[c];
  return sum;
}
template <std::size_t N>
inline double norm(const std::array<double, N>& a) {
  if constexpr (N == 1)
    return std::abs(a[0]);
  else
    return std::sqrt(dot(a, a));
}

/// spin x arm: velocity at the end of an arm.
inline Vector<2> spin_times_arm(const Spin<2>& w, const Vector<2>& r) {
  return {-w[0] * r[1], w[0] * r[0]};
}
inline Vector<3> spin_times_arm(const Spin<3>& w, const Vector<3>& r) {
  return {w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0]};
}
/// arm x force: a torque.
inline Spin<2> arm_times_force(const Vector<2>& r, const Vector<2>& f) {
  return {r[0] * f[1] - r[1] * f[0]};
}
inline Spin<3> arm_times_force(const Vector<3>& r, const Vector<3>& f) {
  return {r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0]};
}

/// The vector of grain `i` in an interleaved array.
template <std::size_t N>
inline std::array<double, N> load(const double* values, std::size_t i) {
  std::array<double, N> r;
  for (std::size_t c = 0; c < N; ++c) r[c] = values[N * i + c];
  return r;
}
template <std::size_t N>
inline void store(double* values, std::size_t i, const std::array<double, N>& a) {
  for (std::size_t c = 0; c < N; ++c) values[N * i + c] = a[c];
}
template <std::size_t N>
inline void add(double* values, std::size_t i, const std::array<double, N>& a) {
  for (std::size_t c = 0; c < N; ++c) values[N * i + c] += a[c];
}

}  // namespace estuary::grains
