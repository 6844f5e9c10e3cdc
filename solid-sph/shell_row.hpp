// Rows of particles on the mid-lines of shells, joined by links: the particles, and the forces and moments
// that a motion makes in them. What the equations are is in shell.hpp.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "internal_force.hpp"
#include "loading.hpp"
#include "shell_section.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {

/// A row of particles along a polyline, each straight piece divided evenly; the last piece closes it when
/// `closed`. Its outline has the left of the walk outside. Throws std::invalid_argument when a piece is
/// shorter than a thousandth of the spacing.
Body fill_row(std::span<const std::array<double, 2>> points, bool closed, double spacing,
              const ShellSection& section);

/// The point of the rows nearest to a place: linear between its two particles.
Transfer row_transfer(const Body& body, const std::array<double, 2>& place);

/// Bit of Body::fixed: the rotation of a particle of a shell does not move.
inline constexpr std::uint8_t kRotationFixed = 8;

/// History: rotation [rad] and its rate [1/s] of each particle of the rows, in their order in the body; then,
/// when any section flows or breaks, kSectionHistory values of each link, 1 once it is broken, and the
/// elastic energy that its breaking set free [J/m].
class ShellRow {
public:
  static constexpr std::size_t kLinkHistory = kSectionHistory + 2;

  /// One section for each member of the body; those without thickness are no shells.
  ShellRow(const Body& body, std::vector<ShellSection> sections);

  [[nodiscard]] std::size_t size() const { return particle_.size(); }
  [[nodiscard]] const std::vector<std::uint32_t>& particles() const { return particle_; }
  [[nodiscard]] bool remembers() const { return remembers_; }
  [[nodiscard]] bool breakable() const { return breakable_; }
  [[nodiscard]] std::vector<double> rest_history() const;

  /// Stresses of a state: forces are added to `fields.force` and deformation gradients set; with `commit`
  /// what has flowed stays in `history`. With a velocity the forces have artificial viscosity in them; the
  /// rates of the rotations are those that the last `turn` has foreseen. Returns the number of particles with
  /// values that are not finite.
  std::int64_t evaluate(std::span<const double> displacement, std::span<double> history, bool commit,
                        Fields& fields, std::span<const double> velocity = {});
  /// Throws Breakdown when a link of the state last evaluated has folded: its ends' fibres have turned by
  /// nearly a right angle or more from across it. Those that can break do so.
  void refuse_folded(std::uint64_t step) const;
  /// Breaks links of the state last evaluated that are past a limit or have folded, the worst of each group
  /// of neighbours. Returns how many.
  std::size_t break_links(std::span<double> history);
  /// The particles at both ends of every broken link.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> broken_links(std::span<const double> history) const;
  /// Takes pressures and tractions on broken links out.
  void drop_broken(std::span<const double> history, Loading& loading) const;

  // Of the state last evaluated, per metre of depth.
  /// Elastic energy, and what the increment would dissipate [J/m].
  [[nodiscard]] double energy() const;
  [[nodiscard]] double plastic_work(std::span<const double> history) const;
  /// What artificial viscosity takes [W/m].
  [[nodiscard]] double viscous_power() const;
  [[nodiscard]] bool viscous() const { return viscous_; }
  [[nodiscard]] bool filters() const { return filters_; }
  /// Turns every free fibre towards the mean of itself and its neighbours, weighted by mass and kernel
  /// (Maurel 2008, ch. 2). Returns the energy that this takes, and the work that the loading's moments do by
  /// it, as added to the state last evaluated; both to first order [J/m].
  std::array<double, 2> filter_normals(std::span<double> history, const Loading& loading, double time,
                                       double fraction);
  /// Elastic energy set free by breaking [J/m].
  [[nodiscard]] double fracture_work(std::span<const double> history) const;
  /// Adds the moments of a loading at `time`, `fraction` of the window gone, to those of the state last
  /// evaluated.
  void add_moments(const Loading& loading, double time, double fraction);
  /// Of the loading's moments during a step of `dt` at the rates in `history` [J/m].
  [[nodiscard]] double moment_work(const Loading& loading, double time, double fraction, double dt,
                                   std::span<const double> history) const;
  // Of a particle of the body that belongs to a row.
  [[nodiscard]] const std::array<double, 2>& rest_fibre(std::uint32_t particle) const {
    return rest_fibre_[local_[particle]];
  }
  /// Change of its fibre since rest, and the rate of that [1/s].
  [[nodiscard]] std::array<std::array<double, 2>, 2> fibre_motion(std::uint32_t particle,
                                                                  std::span<const double> history) const;
  /// Of a member of the body; 0: no shell.
  [[nodiscard]] double thickness(std::size_t member) const { return sections_[member].thickness; }
  /// Of every particle's rotation [kg m2/m].
  [[nodiscard]] const std::vector<double>& inertia() const { return inertia_; }
  /// Half kick of the rates by the moments, and the drift of the rotations when the step begins with it.
  void turn(std::span<double> history, double dt, double decay, double gain, bool ends);

  [[nodiscard]] double kinetic_energy(std::span<const double> history) const;  // of the rotation
  [[nodiscard]] double spin(std::span<const double> history) const;
  [[nodiscard]] double held_moment() const;
  /// Largest squared frequency of a single link at rest [1/s2], an upper bound of that of the rows; where
  /// artificial viscosity wants still shorter steps, that for which the same steps are stable.
  [[nodiscard]] double squared_frequency() const;
  /// The same of the state last evaluated and its whole links, at least that of rest: stretch, shear strain
  /// and forces stiffen a link, and what artificial viscosity asks for grows with the shortening of the links
  /// and, when quadratic, with the speed at which they close. `velocity`: of the whole body; no link is taken
  /// to close slower than the fastest particle moves, because it may be stopped at once.
  [[nodiscard]] double squared_frequency(std::span<const double> velocity,
                                         std::span<const double> history) const;
  /// Of the mid-line: (N t + T n) / h across it, t and n being the link's own frame.
  [[nodiscard]] Tensor<double> first_piola_kirchhoff_at(std::size_t local) const;
  /// Mean of the links at a particle: normal, transverse shear force and moment, and plastic strain.
  [[nodiscard]] std::array<double, 4> section_at(std::size_t local, std::span<const double> history) const;
  /// Particles of the body that no link holds any more.
  [[nodiscard]] std::vector<std::uint32_t> isolated(std::span<const double> history) const;
  /// Broken links; particles that no link holds any more, and their mass [kg/m]; what the broken links have
  /// taken up, elastic and plastic [J/m].
  [[nodiscard]] std::array<double, 4> losses(std::span<const double> history) const;

  // For the relaxation.
  /// A quarter of the sums of the stiffness over a row, with rotations measured by the displacement they make
  /// along a link: masses that bound the frequency by 2 (Gershgorin).
  void relaxation_masses(std::vector<double>& mass, std::vector<double>& inertia) const;
  /// Forces that rounding alone leaves [N/m].
  [[nodiscard]] double round_off() const;
  /// By how much the links that are whole in the state last evaluated exceed the bound that these masses
  /// set, in squared frequency; at least 1.
  [[nodiscard]] double largest_stiffening() const;
  [[nodiscard]] std::vector<double>& moments() { return moment_; }
  [[nodiscard]] bool turns(std::size_t local) const {
    return (body_.fixed[particle_[local]] & kRotationFixed) == 0;
  }

private:
  static constexpr std::uint32_t kNone = 0xffffffffU;
  // Between particles `a` and `b` of the rows.
  struct Link {
    std::uint32_t a, b;
    double length;
    std::array<double, 2> tangent;    // reference
    double membrane, shear, bending;  // E' h, k G h, E' h^3 / 12
    std::uint32_t member;
  };
  // Of a link's motion: its frame, turned by the mean of its ends' rotations, and what it sees in it.
  struct Strain {
    std::array<double, 2> tangent, normal;
    double along, shear, curvature;  // x'.t, x'.n, -theta'
  };
  struct LinkState {
    std::array<double, 2> force, couple;       // on `a`; on both in their `moment_`
    double normal_force, shear_force, moment;  // along the frame [N/m], and [N m/m]
    double stretch, along, shear_strain, energy, stored;
    bool whole;   // not before the first evaluation
    bool folded;  // nothing left along its frame
    double viscous_power;
    std::array<double, 2> viscous_couple;  // in `couple`
  };
  // What resists small changes of a link's motion: stiffness along and across its frame, what has gathered
  // there, and where it is.
  struct Tangent {
    double axial, across, normal_force, shear_force, along, shear_strain;
  };
  // What `along` is at least taken for in logarithms and divisions; a link below has folded.
  static constexpr double kFolded = 0.01;

  [[nodiscard]] Tangent tangent(std::size_t link) const;
  [[nodiscard]] const double* memory(std::span<const double> history, std::size_t link) const {
    return &history[2 * size() + kLinkHistory * link];
  }
  [[nodiscard]] bool broken(std::span<const double> history, std::size_t link) const {
    return breakable_ && memory(history, link)[kSectionHistory] != 0;
  }
  // Calls `work(local, moment)` for every particle on which the loading puts a moment.
  template <typename Work>
  void visit_moments(const Loading& loading, double time, double fraction, const Work& work) const;
  // Of the loading's moments while particles turn by angles.
  [[nodiscard]] double turning_work(const Loading& loading, double time, double fraction,
                                    std::span<const double> angle) const;
  // Of links that close at a speed.
  [[nodiscard]] double squared_frequency(const Link& link, const Tangent& tangent, double closing) const;
  [[nodiscard]] double overload(std::span<const double> history, std::size_t link) const;
  void pull(std::span<const double> displacement, std::span<double> history, bool commit, std::size_t link,
            std::span<const double> velocity);
  // What forces and a moment of a link do on the rotations of its ends.
  static std::array<double, 2> couple(const Link& link, const Strain& strain, const SectionVector& s) {
    const double both = -0.5 * link.length * (s.membrane * strain.shear - s.shear * strain.along);
    return {both - s.bending, both + s.bending};
  }
  // Viscous normal force, shear force and moment of a link, work-conjugate like the elastic ones; notes what
  // they take.
  SectionVector drag(std::size_t link, std::span<const double> velocity, const Strain& strain);
  void gather(std::span<const double> displacement, std::size_t local, Fields& fields);

  const Body& body_;
  std::vector<ShellSection> sections_;
  std::int64_t folded_ = 0;  // links, in the state last evaluated
  bool remembers_ = false, breakable_ = false, viscous_ = false, quadratic_ = false, filters_ = false;
  std::vector<double> rate_;      // of the rotations, foreseen for the end of a step [1/s]; with viscosity
  std::vector<double> filtered_;  // angles by which the filter turns the fibres [rad]; with a filter
  std::vector<std::uint32_t> particle_;  // of the body, ascending
  std::vector<std::uint32_t> local_;     // of every particle of the body
  std::vector<Link> links_;
  std::vector<LinkState> at_;
  std::vector<std::uint32_t> before_, after_;  // links that end and begin at a particle
  std::vector<double> fibre_angle_;            // of the reference fibres [rad]
  std::vector<double> inertia_;                // rotary [kg m2/m]
  std::vector<std::array<double, 2>> rest_fibre_, fibre_;
  std::vector<double> moment_;  // on every particle [N m/m]
};

}  // namespace estuary::solid
