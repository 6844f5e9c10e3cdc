// Several nodes at a time: a value of each in one vector register.
//
// The compiler's own vector types (GCC, Clang) rather than loops left to its vectoriser: a step then computes
// every node by the same operations in the same order whatever the width, and the last nodes of a run need no
// loop of their own.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace estuary::fluid {

// A run's last vector may reach beyond it by less than eight nodes: so far the padding of rows goes
// (populations.cpp).
#if defined(__AVX512F__)
inline constexpr std::size_t vector_bytes_of_double = 64;
inline constexpr std::size_t vector_bytes_of_float = 32;
#elif defined(__AVX__)
inline constexpr std::size_t vector_bytes_of_double = 32;
inline constexpr std::size_t vector_bytes_of_float = 32;
#else
inline constexpr std::size_t vector_bytes_of_double = 16;
inline constexpr std::size_t vector_bytes_of_float = 16;
#endif

/// Vectors of a real type, and of integers of its size.
template <class Real>
struct Lanes;
template <>
struct Lanes<double> {
  typedef double Vector [[gnu::vector_size(vector_bytes_of_double)]];
  typedef std::int64_t Mask [[gnu::vector_size(vector_bytes_of_double)]];
  static constexpr int count = static_cast<int>(vector_bytes_of_double / sizeof(double));
};
template <>
struct Lanes<float> {
  typedef float Vector [[gnu::vector_size(vector_bytes_of_float)]];
  typedef std::int32_t Mask [[gnu::vector_size(vector_bytes_of_float)]];
  static constexpr int count = static_cast<int>(vector_bytes_of_float / sizeof(float));
};

/// The type of one lane; of a plain number the number's.
template <class Value>
struct RealOf {
  using type = std::remove_cvref_t<decltype(std::declval<Value>()[0])>;
};
template <>
struct RealOf<double> {
  using type = double;
};
template <>
struct RealOf<float> {
  using type = float;
};

/// At any address.
template <class Real>
[[gnu::always_inline]] inline typename Lanes<Real>::Vector load(const Real* from) {
  typename Lanes<Real>::Vector value;
  std::memcpy(&value, from, sizeof value);
  return value;
}
template <class Real>
[[gnu::always_inline]] inline void store(Real* to, const typename Lanes<Real>::Vector& value) {
  std::memcpy(to, &value, sizeof value);
}

/// True in the first `lanes` lanes.
template <class Real>
[[gnu::always_inline]] inline typename Lanes<Real>::Mask first_lanes(int lanes) {
  typename Lanes<Real>::Mask number;
  for (int k = 0; k < Lanes<Real>::count; ++k) number[k] = k;
  return number < static_cast<std::remove_cvref_t<decltype(number[0])>>(lanes);
}

/// `function` of each lane.
template <class Value, class Function>
[[gnu::always_inline]] inline Value each_lane(const Value& value, Function&& function) {
  if constexpr (std::is_floating_point_v<Value>) {
    return function(value);
  } else {
    using Real = typename RealOf<Value>::type;
    Value result;
    for (int k = 0; k < Lanes<Real>::count; ++k) result[k] = function(value[k]);
    return result;
  }
}

}  // namespace estuary::fluid
