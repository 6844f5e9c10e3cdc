// Several nodes at a time: a value of each in one vector register.
//
// The compiler's own vector types (GCC, Clang) rather than loops left to its vectoriser: a step then computes
// every node by the same operations in the same order whatever the width. The last nodes of a run are part of
// a vector whose other lanes are neither read nor written.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <type_traits>

#if defined(__AVX__)
#include <immintrin.h>
#endif

namespace estuary::fluid {

#if defined(__AVX512VL__)
inline constexpr std::size_t vector_bytes_of_double = 64;
inline constexpr std::size_t vector_bytes_of_float = 32;
#elif defined(__AVX__)
inline constexpr std::size_t vector_bytes_of_double = 32;
inline constexpr std::size_t vector_bytes_of_float = 32;
#else
inline constexpr std::size_t vector_bytes_of_double = 16;
inline constexpr std::size_t vector_bytes_of_float = 16;
#endif

/// Vectors of a real type.
template <class Real>
struct Lanes;
template <>
struct Lanes<double> {
  typedef double Vector [[gnu::vector_size(vector_bytes_of_double)]];
  static constexpr int count = static_cast<int>(vector_bytes_of_double / sizeof(double));
};
template <>
struct Lanes<float> {
  typedef float Vector [[gnu::vector_size(vector_bytes_of_float)]];
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

#if defined(__AVX__) && !defined(__AVX512VL__)
/// All bits of the lanes whose bit is set.
template <class Real>
[[gnu::always_inline]] inline __m256i lane_mask(unsigned bits) {
  typedef int Words [[gnu::vector_size(32)]];
  constexpr Words each =
      std::is_same_v<Real, double> ? Words{1, 1, 2, 2, 4, 4, 8, 8} : Words{1, 2, 4, 8, 16, 32, 64, 128};
  return __builtin_bit_cast(__m256i, (each & static_cast<int>(bits)) != 0);
}
#endif

/// The lanes whose bit is set from memory, the others zero. No other memory is touched. One by one where the
/// processor has no masks.
template <class Real>
[[gnu::always_inline]] inline typename Lanes<Real>::Vector load_lanes(const Real* from, unsigned bits) {
#if defined(__AVX512VL__)
  if constexpr (std::is_same_v<Real, double>) {
    return _mm512_maskz_loadu_pd(static_cast<__mmask8>(bits), from);
  } else {
    return _mm256_maskz_loadu_ps(static_cast<__mmask8>(bits), from);
  }
#elif defined(__AVX__)
  if constexpr (std::is_same_v<Real, double>) {
    return _mm256_maskload_pd(from, lane_mask<Real>(bits));
  } else {
    return _mm256_maskload_ps(from, lane_mask<Real>(bits));
  }
#else
  typename Lanes<Real>::Vector value{};
  for (int k = 0; k < Lanes<Real>::count; ++k) {
    if ((bits >> k & 1U) != 0) value[k] = from[k];
  }
  return value;
#endif
}
/// Those lanes alone.
template <class Real>
[[gnu::always_inline]] inline void store_lanes(Real* to, unsigned bits,
                                               const typename Lanes<Real>::Vector& value) {
#if defined(__AVX512VL__)
  if constexpr (std::is_same_v<Real, double>) {
    _mm512_mask_storeu_pd(to, static_cast<__mmask8>(bits), value);
  } else {
    _mm256_mask_storeu_ps(to, static_cast<__mmask8>(bits), value);
  }
#elif defined(__AVX__)
  if constexpr (std::is_same_v<Real, double>) {
    _mm256_maskstore_pd(to, lane_mask<Real>(bits), value);
  } else {
    _mm256_maskstore_ps(to, lane_mask<Real>(bits), value);
  }
#else
  for (int k = 0; k < Lanes<Real>::count; ++k) {
    if ((bits >> k & 1U) != 0) to[k] = value[k];
  }
#endif
}

/// Lanes of eight that lie in memory without gaps (`some`, and as many of the first lanes: `first`), and
/// lanes that lie where they are counted (`others`).
struct SpreadLanes {
  unsigned some;
  unsigned first;
  unsigned others;
};
/// As many lanes as a vector has, from `lane` on: those of `some` from `packed`, those of `others` from
/// `from`, the rest zero. Both are of lane 0.
template <class Real>
[[gnu::always_inline]] inline typename Lanes<Real>::Vector load_spread(const Real* packed, const Real* from,
                                                                       const SpreadLanes& lanes, int lane) {
#if defined(__AVX512VL__)
  static_cast<void>(lane);  // 0
  const auto some = static_cast<__mmask8>(lanes.some);
  if constexpr (std::is_same_v<Real, double>) {
    return _mm512_mask_expand_pd(load_lanes(from, lanes.others), some, load_lanes(packed, lanes.first));
  } else {
    return _mm256_mask_expand_ps(load_lanes(from, lanes.others), some, load_lanes(packed, lanes.first));
  }
#else
  typename Lanes<Real>::Vector value{};
  packed += std::popcount(lanes.some & ((1U << lane) - 1U));
  for (int k = 0; k < Lanes<Real>::count; ++k) {
    if ((lanes.some >> (lane + k) & 1U) != 0) {
      value[k] = *packed++;
    } else if ((lanes.others >> (lane + k) & 1U) != 0) {
      value[k] = from[lane + k];
    }
  }
  return value;
#endif
}
/// And back.
template <class Real>
[[gnu::always_inline]] inline void store_spread(Real* packed, Real* to, const SpreadLanes& lanes, int lane,
                                                const typename Lanes<Real>::Vector& value) {
#if defined(__AVX512VL__)
  static_cast<void>(lane);
  const auto some = static_cast<__mmask8>(lanes.some);
  if constexpr (std::is_same_v<Real, double>) {
    store_lanes(packed, lanes.first, _mm512_maskz_compress_pd(some, value));
  } else {
    store_lanes(packed, lanes.first, _mm256_maskz_compress_ps(some, value));
  }
  store_lanes(to, lanes.others, value);
#else
  packed += std::popcount(lanes.some & ((1U << lane) - 1U));
  for (int k = 0; k < Lanes<Real>::count; ++k) {
    if ((lanes.some >> (lane + k) & 1U) != 0) {
      *packed++ = value[k];
    } else if ((lanes.others >> (lane + k) & 1U) != 0) {
      to[lane + k] = value[k];
    }
  }
#endif
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
