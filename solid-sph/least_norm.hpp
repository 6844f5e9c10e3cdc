// Least-norm solutions of a few linear conditions on many unknowns, by the singular value decomposition of
// the conditions' rows: one-sided Jacobi rotations, accurate to the last digits for small matrices (Hestenes
// 1958; Demmel & Veselic 1992).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace estuary::solid {

/// Rows of coefficients, all of one length: the unknowns'.
using Rows = std::vector<std::vector<double>>;

class LeastNorm {
public:
  explicit LeastNorm(Rows conditions);

  /// Number of singular values above `smallest`.
  [[nodiscard]] std::size_t rank(double smallest) const;
  [[nodiscard]] double largest() const;
  /// x of least norm among those with the least |A x - target|; directions whose singular value is not above
  /// `smallest` count as absent.
  [[nodiscard]] std::vector<double> solve(std::span<const double> target, double smallest) const;
  /// Takes from `x` what the conditions see of it.
  void project_out(std::vector<double>& x) const;

private:
  Rows conditions_;
  Rows rotation_;                       // orthogonal; rotation * conditions = rotated
  Rows rotated_;                        // rows orthogonal to one another
  std::vector<double> singular_value_;  // their lengths
  std::size_t unknowns_ = 0;
};

[[nodiscard]] double dot(std::span<const double> a, std::span<const double> b);

}  // namespace estuary::solid
