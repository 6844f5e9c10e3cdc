// The body as particles: what stays (Body) and what moves (State), as structures of arrays.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace estuary::solid {

/// Sides of the box in the order of a clockwise walk: up the left side, along the top, down the right, back
/// below.
enum class Side : std::size_t { left = 0, top = 1, right = 2, bottom = 3 };
inline constexpr std::array<const char*, 4> kSideNames{"left", "top", "right", "bottom"};

/// How a clamped side is held.
enum class Clamp {
  line,       // a row of fixed particles, of half the volume, exactly on the side
  extra_rows  // full cells up to the side, and one more fixed row whose centres lie half a spacing outside
};

/// Where particles lie relative to a free side.
enum class Placement {
  on_contour,   // a row exactly on the side, of half the volume (a quarter at corners)
  cell_centres  // the outermost centres half a spacing inside, as in the thesis
};

/// An axis-aligned box to be filled with particles. Lengths in m.
struct Box {
  std::array<double, 2> from{};
  std::array<double, 2> to{};
  double spacing = 0;  // wished for; each direction takes the nearest one that fills the box
  std::array<bool, 4> clamped{};
  Clamp clamp = Clamp::line;
  Placement placement = Placement::on_contour;
  bool periodic = false;  // in x
  // An even number of spacings across, with particles on both sides. With an odd one the pressure that
  // alternates from row to row resists bending: a strain k y of the volume can then not be met by any motion
  // of the rows, and the energy (k d^2 / L)^2 / 8 per volume and bulk modulus that is left (spacing d,
  // thickness L) locks a nearly incompressible body.
  bool even = false;

  [[nodiscard]] double length(std::size_t axis) const { return to[axis] - from[axis]; }
};

/// Particles along a contour, walked clockwise round the body (holes the other way): the outside is on the
/// left of each segment.
struct Outline {
  std::vector<std::uint32_t> particle;
  bool closed = true;
};

/// A body that moves as one: two translations of its centre of mass and a rotation, each with a linear spring
/// and damper of its own. Its particles are its contour; they have no mass of their own. Per metre of depth.
struct RigidBody {
  std::size_t member = 0;
  std::uint32_t first = 0, last = 0;  // its particles are first .. last - 1
  std::array<double, 2> centre{};     // of mass, reference [m]
  double mass = 0;                    // [kg/m]
  double inertia = 0;                 // about the centre of mass [kg m2/m]
  // x, y, rotation: [N/m2], [N m/m]; [N s/m2], [N m s/m]; [m], [rad].
  std::array<double, 3> spring{}, damper{};
  std::array<double, 3> rest{};  // where the springs are slack
  std::array<bool, 3> held{};    // degrees of freedom that stay, or follow a prescribed motion

  [[nodiscard]] double inertia_of(std::size_t freedom) const { return freedom == 2 ? inertia : mass; }
};

/// The reference configuration; nothing here changes in a run. Vectors of particles are x0 y0 x1 y1 ...
/// Several bodies lie one after another.
struct Body {
  Box box;                               // of a single box; its clamp and placement hold for all
  std::array<std::size_t, 2> columns{};  // particles in x and y of a single box
  std::array<double, 2> spacing{};       // [m]
  double smoothing_length = 0;           // [m]
  std::vector<double> position;          // reference positions [m], 2 per particle
  std::vector<double> volume;            // [m2], per metre of depth
  // What a particle stands for in the elastic energy [m2]: its volume, or with `end_corrected` that times the
  // weights of a midpoint rule corrected at its ends, so that the energy of bending is integrated exactly
  // across a beam.
  std::vector<double> energy_volume;
  std::vector<double> mass;  // [kg/m]
  std::vector<std::uint8_t>
      fixed;  // components that do not move by themselves: 1 x, 2 y, 3 both, 7 of a rigid body
  std::vector<std::uint8_t> edge;    // 1 for particles whose cell is cut by the contour they lie on
  std::vector<std::uint8_t> member;  // number of the body a particle belongs to
  std::vector<Outline> outlines;     // of bodies with particles on their contour
  std::vector<std::uint32_t> outline_member;
  std::vector<RigidBody> rigid;
  std::size_t stress_points = 0;  // entries at the end that carry stress and no mass, see stress_points.hpp

  [[nodiscard]] std::size_t size() const { return volume.size(); }
  [[nodiscard]] std::size_t particles() const { return size() - stress_points; }
  [[nodiscard]] double mean_spacing() const;
  [[nodiscard]] bool holds(std::size_t particle, std::size_t component) const {
    return (fixed[particle] >> component & 1U) != 0;
  }
  /// Moved by a rigid body.
  [[nodiscard]] bool carried(std::size_t particle) const { return (fixed[particle] & 4U) != 0; }
};

/// Particles that have been taken out of a motion, per metre of depth.
struct Removed {
  double count = 0, mass = 0;               // [kg/m]
  std::array<double, 2> momentum{};         // [kg/s]
  double angular_momentum = 0, energy = 0;  // about the origin [kg m/s], kinetic [J/m]
};

/// What a run carries from window to window.
struct State {
  std::vector<double> displacement;   // [m], 2 per particle
  std::vector<double> velocity;       // [m/s]
  double time = 0;                    // [s]
  double external_work = 0;           // of loads, gravity and prescribed motion since the start [J/m]
  double viscous_work = 0;            // taken by artificial viscosity and mass damping [J/m]
  std::vector<double> history;        // of laws that have one, see Law::history
  double contact_time = 0;            // in which bodies touched [s]
  double contact_work = 0;            // lost in impacts and by friction [J/m]
  std::vector<std::uint8_t> removed;  // of every particle, once there are any: it carried nothing any more
  Removed lost;                       // what these had
  std::vector<double> rigid;  // x, y, rotation and their rates of each rigid body [m], [rad], [m/s], [rad/s]
};

/// Particles on a regular grid, the faster index along the thinner direction.
Body fill(const Box& box, double density, double smoothing_ratio, bool end_corrected);
/// `next` after the particles of `body`, as another member.
void append(Body& body, const Body& next);
State at_rest(const Body& body);

/// Number of particles `fill` would make in x and y.
std::array<std::size_t, 2> count_columns(const Box& box);
/// Spacing `fill` would use in x and y [m].
std::array<double, 2> actual_spacing(const Box& box);

}  // namespace estuary::solid
