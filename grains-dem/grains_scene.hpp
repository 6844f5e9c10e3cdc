// The [grains] table of a scene and what the grains share with the rest of it, read and checked.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "bonds.hpp"
#include "cement.hpp"
#include "contact_law.hpp"
#include "dynamics.hpp"
#include "mesh_file.hpp"
#include "participant.hpp"
#include "scene.hpp"

namespace estuary::grains {

/// Radii between `minimum` and `maximum`. The beta law spreads d_r = (d - d_min) / (d_max - d_min) with the
/// density d_r^(a-1) (1 - d_r)^(b-1), of the number of grains or of their volume (Voivret et al. 2007).
struct Grading {
  enum class Law { single, uniform, beta };
  Law law = Law::single;
  double minimum = 0, maximum = 0;  // radii [m]
  double a = 2, b = 2;
  bool by_volume = false;
};

/// Some grains of the scene: given one by one, on a lattice, spread over a box, or read from a file.
struct GroupScene {
  enum class Kind { positions, lattice, spread, file };
  Kind kind = Kind::positions;
  std::vector<double> positions;  // interleaved
  std::vector<double> radii;      // one per position, or empty
  Grading grading;
  bool triangular = false;
  std::vector<double> from, to;
  double pitch = 0;
  std::vector<double> stretch;  // of a lattice, per direction
  std::vector<std::int64_t> counts;
  std::int64_t count = 0;
  std::string file;
  double density = 0;
  std::vector<double> velocity, spin;
  double random_velocity = 0;
  std::int64_t seed = 1;
  bool held = false;
};

struct WallScene {
  std::string name;
  std::vector<double> point, normal;  // a plane
  std::vector<double> polyline;       // or interleaved nodes, grains on the left
  bool closed = false;
  TriangleMesh mesh;                  // or triangles in space
  std::vector<std::string> velocity;  // expressions of t; empty: at rest
  std::vector<std::string> spin;      // about `pivot`, likewise
  std::vector<double> pivot;
  ContactConstants constants;

  [[nodiscard]] bool is_plane() const { return polyline.empty() && mesh.triangle.empty(); }
};

enum class WatchKind { totals, grain, region, wall };
struct WatchScene {
  std::string name;
  WatchKind kind = WatchKind::totals;
  std::size_t grain = 0;
  std::vector<double> from, to;
  std::string wall;
};

struct DepositScene {
  bool active = false;
  std::optional<double> friction;
  std::optional<double> restitution;
  std::vector<double> gravity;
  double end_time = 0;
  double tolerance = 0;  // mean speed / (gravity x diameter)^(1/2) that counts as rest
  bool hold = false;     // keep the grains where they came to rest
  std::optional<double> target_porosity;
  double porosity_tolerance = 0.005;
};

/// What a fluid around the grains changes for them.
struct FluidScene {
  bool present = false;
  double density = 0;
  bool reduced_gravity =
      true;  // less the weight of the fluid displaced, or whole: the fluid's own pressure carries
  // See medium.hpp: in masses of the fluid displaced, at most this over the radius, where that is not 0 [m];
  // windows by which forces and accelerations are carried on.
  double virtual_mass = 0, virtual_mass_over_radius = 0, lead = 0;
  bool may_resound = false;  // grains too light for how and when the fluid meets them
  // Body force that drives the fluid, expressions of t: its pressure gradient acts on grains too. Empty when
  // there is none.
  std::vector<std::string> acceleration;
  bool has_body_force = false;  // in the fluid's own table: gravity or what drives it
  // What else the fluid's own table says, to hold the grains' against.
  std::optional<double> lattice_density, spacing, time_step;
  bool interpolated = false;  // of the two ways in which the fluid meets grains
  std::array<std::optional<bool>, 3> periodic{};
};

struct GrainsScene {
  int dimension = 2;
  double window = 0, end_time = 0;
  bool steady = false;  // grains are held where they are while the fluid finds its equilibrium
  bool coupled_to_fluid = false;
  bool coupled_to_solid = false;
  bool repeats_windows = false;

  LawChoice law;
  ContactConstants constants;
  ContactConstants solid_constants;  // with the wet surface of a solid
  double restitution = 1;
  double young_modulus = 0, poisson_ratio = 0, impact_speed = 0;  // Hertz
  double density = 0;
  std::vector<double> gravity;
  std::vector<double> from, to;  // the box; empty when none is given
  std::array<bool, 3> periodic{};
  double contact_margin = 0;
  std::optional<double> skin;
  Integrator integrator = Integrator::verlet;
  int gear_terms = 5, gear_corrections = 1;
  double steps_per_contact = 20;
  std::optional<double> time_step;
  std::vector<GroupScene> groups;
  std::vector<WallScene> walls;
  std::vector<WatchScene> watches;
  FluidScene fluid;
  BondLaw bond;
  Lubrication lubrication;
  DepositScene deposit;
  CementScene cement;

  [[nodiscard]] std::size_t axes() const { return static_cast<std::size_t>(dimension); }
};

/// Notes every problem in `scene`; the result counts only when there are none.
GrainsScene read_grains_scene(Scene& scene, const std::string& role);

/// Constants of a contact from the scene's material, with another friction or restitution.
ContactConstants with_material(const GrainsScene& scene, double friction, double restitution);

}  // namespace estuary::grains
