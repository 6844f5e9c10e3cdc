// Solid bodies that break: links between neighbours, taken out of the reference neighbourhood.
//
// A link breaks when its stretch, the mean plastic strain of its ends, or the energy that a crack through it
// would set free per area passes a limit. With the spacing d, the traction t across the link (mean of both
// ends, on the area at rest that stands across it), the modulus E' of a bar in the plane and the mean w_p of
// both ends' plastic work that energy is kTip / 2 t^2 d / E' + 2 w_p d. Of t what pulls and what slides
// counts, not what presses. At distance r ahead of a crack 2 pi r t^2 = K^2 = E' G (Irwin 1957), whatever is
// stressed along the crack; which r the first whole link ahead of the tip stands for is measured
// (rupture.cpp), with the default share of stabilisation in the stress. Flow localises in two spacings (crack
// band: Bazant & Oh 1983). Of links that share an end only the one furthest past its limit breaks in a step.
//
// A crack is opaque: a link across which every way over a common neighbour, by two shorter links, is broken
// breaks with them. Otherwise the diagonals would hold a crack that runs between two rows.
//
// A touched particle gets the linearly corrected gradient of the links it has left (Maurel 2008, ch. 2) and
// stands for as much less volume as its moment of links has lost across the crack, half of it at a straight
// one: the operator then is the one of a row on a free side, and the energy of what is lost is set free. A
// body that has flowed keeps the deformation gradient it had, F = (I + H) C with the C of the break; an
// elastic one takes that of its links, C = I. A particle without two links in different directions carries
// nothing more and flies on.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "neighbourhood.hpp"
#include "rupture_limits.hpp"

namespace estuary::solid {

class Rupture {
public:
  /// `pairs` is what the sweeps use; it changes with every break. One set of limits and one modulus E' [Pa]
  /// for each member.
  /// Links that cross a segment (x0, y0, x1, y1) of `cracks` are broken from the start; std::invalid_argument
  /// for a segment, longer than the spacing, that crosses none.
  Rupture(const Body& body, Neighbourhood& pairs, std::vector<RuptureLimits> limits,
          std::vector<double> moduli, std::vector<std::array<double, 4>> cracks, Kernel kernel);

  /// With the volumes that are left.
  [[nodiscard]] const Body& body() const { return body_; }
  /// Deformation gradient of zero displacement, xx xy yx yy per particle: the C above.
  [[nodiscard]] const std::vector<double>& base() const { return base_; }

  /// What belongs into the history of the solver, behind that of the law: of every pair whether it is broken,
  /// C of every particle, and the energy set free [J/m].
  [[nodiscard]] std::vector<double> rest_history() const;
  /// Makes the operator that of a history.
  void restore(std::span<const double> history);
  /// Of every particle; no plastic strain and work: an elastic body.
  struct Loads {
    std::span<const double> stress;  // first Piola-Kirchhoff times volume, xx xy yx yy [N m per m]
    std::span<const double> law;  // history of the law, `law_size` each: [4] plastic strain, last: its work
    std::size_t law_size = 0;
  };
  /// Finds the links that are past their limits. Returns whether there are any.
  bool find_overloaded(std::span<const double> displacement, const Loads& loads,
                       std::span<const double> history);
  /// Finds the last links of particles that hang on one and carry nothing. Returns whether there are any.
  bool find_hanging(std::span<const double> history);
  /// Breaks those, of links that share an end the worst. Returns the particles that carry nothing more, some
  /// perhaps twice.
  std::span<const std::uint32_t> break_links(std::span<const double> displacement,
                                             const std::vector<double>& deformation, bool plastic,
                                             std::span<double> history);
  void set_free(double energy, std::span<double> history) const { history.back() += energy; }
  [[nodiscard]] double energy_set_free(std::span<const double> history) const { return history.back(); }
  /// By how much the operator of the links left may raise squared frequencies over those at rest, at least 1:
  /// the largest of V_i (sum_j |g_ij|^2 / m_j + |sum_j g_ij|^2 / m_i) over that at rest of the same member.
  /// Half a straight crack's volume makes up for its gradients; ragged ones may be steeper.
  [[nodiscard]] double steepening() const { return steepening_; }
  /// Particles without any link, of the history last applied. Who hangs on one still feels it, until it is
  /// cut.
  [[nodiscard]] std::vector<std::uint32_t> isolated(std::span<const double> history) const;
  [[nodiscard]] TornContours torn_contours(std::span<const double> history) const;
  /// Broken links, isolated particles, their mass [kg/m].
  [[nodiscard]] std::array<double, 3> losses(std::span<const double> history) const;

private:
  /// t^2 / (2 E') of a link [J/m3].
  [[nodiscard]] double traction_energy(std::size_t pair, std::size_t i, std::span<const double> stress) const;
  /// Breaks the longer links at a particle that are left without any way round. Returns whether there were
  /// any.
  bool cut_crossing(std::size_t i, std::span<double> history);
  [[nodiscard]] double overload(std::size_t pair, std::size_t i, std::span<const double> displacement,
                                const Loads& loads) const;
  [[nodiscard]] bool intact(std::span<const double> history, std::size_t pair) const {
    return history[pair] == 0;
  }
  /// Gradients of the particle's links that are left, without C; returns the share of the volume left, 0 when
  /// it is isolated, nothing when no link of it is broken.
  std::optional<double> fit(std::size_t i, std::span<const double> history);
  void apply(std::span<const double> history);
  /// Squared frequency that the stress of a particle makes, over its modulus [m/kg].
  [[nodiscard]] double steepness(std::size_t i) const;
  void check_cracks() const;
  /// Ends of a pair at rest: x0, y0, x1, y1.
  [[nodiscard]] std::array<double, 4> link(std::size_t i, std::size_t pair) const;
  void touch(std::uint32_t i) {
    if (pending_[i] == 0) touched_.push_back(i);
    pending_[i] = 1;
  }

  struct Candidate {
    double overload;
    std::uint32_t pair, i, j;
  };
  Body body_;
  const Body& whole_body_;
  Neighbourhood& pairs_;
  const Neighbourhood whole_;
  std::vector<RuptureLimits> limits_;
  std::vector<double> moduli_;
  std::vector<std::array<double, 4>> cracks_;
  std::vector<double> length_;         // at rest, of every pair [m]
  std::vector<double> weight_;         // |W'| / R of every pair
  std::vector<std::uint32_t> mirror_;  // the same pair seen from its other end
  std::vector<double> base_;
  std::vector<double> applied_;  // the history that `pairs_` belongs to
  std::vector<std::uint8_t> isolated_;
  double steepening_ = 1;
  std::vector<double> rest_steepness_;            // largest of each member
  std::array<std::vector<Candidate>, 64> found_;  // of blocks of particles
  std::vector<Candidate> candidates_;
  std::vector<std::uint8_t> taken_, pending_;
  std::vector<std::uint32_t> touched_, unloaded_;  // touched: still to be fitted, in order
};

}  // namespace estuary::solid
