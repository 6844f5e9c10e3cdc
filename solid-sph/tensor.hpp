// Second-order tensors of the plane, written once for plain numbers and for numbers that carry derivatives.
#pragma once

#include <array>
#include <cmath>

namespace estuary::solid {

/// Components [xx xy; yx yy].
template <class T>
struct Tensor {
  T xx{}, xy{}, yx{}, yy{};
};

template <class T>
Tensor<T> operator+(const Tensor<T>& a, const Tensor<T>& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.yx + b.yx, a.yy + b.yy};
}
template <class T>
Tensor<T> operator-(const Tensor<T>& a, const Tensor<T>& b) {
  return {a.xx - b.xx, a.xy - b.xy, a.yx - b.yx, a.yy - b.yy};
}
template <class T, class S>
Tensor<T> scaled(const Tensor<T>& a, const S& s) {
  return {a.xx * s, a.xy * s, a.yx * s, a.yy * s};
}
template <class T>
Tensor<T> product(const Tensor<T>& a, const Tensor<T>& b) {
  return {a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy, a.yx * b.xx + a.yy * b.yx,
          a.yx * b.xy + a.yy * b.yy};
}
template <class T>
Tensor<T> transposed(const Tensor<T>& a) {
  return {a.xx, a.yx, a.xy, a.yy};
}
template <class T>
T determinant(const Tensor<T>& a) {
  return a.xx * a.yy - a.xy * a.yx;
}
/// det(a) a^-T, which needs no division.
template <class T>
Tensor<T> cofactor(const Tensor<T>& a) {
  return {a.yy, -a.yx, -a.xy, a.xx};
}
/// a : b
template <class T>
T contraction(const Tensor<T>& a, const Tensor<T>& b) {
  return a.xx * b.xx + a.xy * b.xy + a.yx * b.yx + a.yy * b.yy;
}
inline Tensor<double> identity() {
  return {1, 0, 0, 1};
}

/// A number with its derivatives with respect to the four components of a tensor (forward-mode automatic
/// differentiation): a law written for it gives its exact tangent.
struct Dual {
  double value = 0;
  std::array<double, 4> derivative{};

  Dual() = default;
  Dual(double v) : value(v) {}  // NOLINT: constants enter formulas as plain numbers
  static Dual variable(double v, std::size_t component) {
    Dual d(v);
    d.derivative[component] = 1;
    return d;
  }
  Dual operator-() const { return Dual() - *this; }
  friend Dual operator+(const Dual& a, const Dual& b) {
    Dual r(a.value + b.value);
    for (std::size_t i = 0; i < 4; ++i) r.derivative[i] = a.derivative[i] + b.derivative[i];
    return r;
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    Dual r(a.value - b.value);
    for (std::size_t i = 0; i < 4; ++i) r.derivative[i] = a.derivative[i] - b.derivative[i];
    return r;
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual r(a.value * b.value);
    for (std::size_t i = 0; i < 4; ++i)
      r.derivative[i] = a.derivative[i] * b.value + a.value * b.derivative[i];
    return r;
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    Dual r(a.value / b.value);
    for (std::size_t i = 0; i < 4; ++i)
      r.derivative[i] = (a.derivative[i] - r.value * b.derivative[i]) / b.value;
    return r;
  }
  friend Dual exp(const Dual& a) {
    Dual r(std::exp(a.value));
    for (std::size_t i = 0; i < 4; ++i) r.derivative[i] = a.derivative[i] * r.value;
    return r;
  }
  friend Dual log(const Dual& a) {
    Dual r(std::log(a.value));
    for (std::size_t i = 0; i < 4; ++i) r.derivative[i] = a.derivative[i] / a.value;
    return r;
  }
};

/// Without its derivatives.
inline double plain(double a) {
  return a;
}
inline double plain(const Dual& a) {
  return a.value;
}

}  // namespace estuary::solid
