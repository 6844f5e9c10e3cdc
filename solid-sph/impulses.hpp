// Impulses that keep bodies apart, as Lagrange multipliers (Casadei 2003; Maurel 2008, ch. 3).
//
// A row couples the normal velocity of a point to that of the surface it meets, C v >= -gap / dt. With
// v = v_free + M^-1 C^T lambda the multipliers obey 0 <= lambda, 0 <= C v + gap / dt, one of them zero: an
// active set found by conjugate gradients on C M^-1 C^T (all rows that share particles are solved together),
// from which rows that would pull are dropped and to which rows that would close too fast are added. Coulomb
// friction follows row by row, bounded by its share of lambda.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace estuary::solid {

/// One meeting of a point with a surface. Degrees of freedom are those of particles (2 each) and, after them,
/// of rigid bodies (x, y, rotation).
struct ContactRow {
  static constexpr std::size_t kMost = 9;
  std::uint32_t count = 0;
  std::array<std::uint32_t, kMost> freedom{};
  std::array<double, kMost> normal{}, tangent{};  // coefficients of the relative velocity
  double gap = 0;                                 // [m]; negative when inside
  double floor = 0;                               // least relative normal velocity [m/s]
  std::array<double, 2> direction{};              // of the push on the point
  std::uint32_t point = 0;
  std::uint8_t point_member = 0, surface_member = 0;
  double impulse = 0, friction = 0;  // found by ImpulseSolver [N s/m]

  void add(std::uint32_t which, double along_normal, double along_tangent) {
    freedom[count] = which;
    normal[count] = along_normal;
    tangent[count++] = along_tangent;
  }
  void add_tangent(std::uint32_t which, double along_tangent) {
    for (std::uint32_t k = 0; k < count; ++k)
      if (freedom[k] == which) {
        tangent[k] += along_tangent;
        return;
      }
    add(which, 0, along_tangent);
  }
};

class ImpulseSolver {
public:
  /// `inverse_mass` of every degree of freedom; 0 where it does not yield.
  explicit ImpulseSolver(std::vector<double> inverse_mass)
      : inverse_mass_(std::move(inverse_mass)), spread_(inverse_mass_.size(), 0.0) {}

  [[nodiscard]] const std::vector<double>& inverse_mass() const { return inverse_mass_; }
  /// Finds the impulses of all rows and adds them to `velocity`. Returns the iterations it took.
  std::size_t solve(std::vector<ContactRow>& rows, double friction, std::vector<double>& velocity);

private:
  [[nodiscard]] double relative_velocity(const ContactRow& row, const std::vector<double>& velocity) const;
  /// result = C M^-1 C^T x over the active rows.
  void product(const std::vector<ContactRow>& rows, const std::vector<double>& x,
               std::vector<double>& result);
  std::size_t solve_active(const std::vector<ContactRow>& rows);

  std::vector<double> inverse_mass_;
  std::vector<double> spread_;  // M^-1 C^T x, zero between uses
  std::vector<std::uint32_t> active_;
  std::vector<std::uint8_t> is_active_;
  std::vector<double> yielding_;  // diagonal of C M^-1 C^T; rows between two bodies that do not yield have 0
  std::vector<double> wanted_, lambda_, residual_, direction_, image_, diagonal_;
};

}  // namespace estuary::solid
