// The [solid] table of a scene and what the solid shares with the rest of it, read and checked.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fluid_material.hpp"
#include "outline_filling.hpp"
#include "participant.hpp"
#include "pinball.hpp"
#include "scene.hpp"
#include "shell_section.hpp"
#include "solver.hpp"

namespace estuary::solid {

enum class Shape { box, disc, polygon, points, polyline };

struct MaterialScene {
  double density = 0;
  double young_modulus = 0;
  double poisson_ratio = 0;
  Plasticity plasticity;
};

struct BodyScene;

/// A body that moves as one; see RigidBody for the meaning and units.
struct RigidScene {
  double mass = 0, inertia = 0;  // 0: of the outline with the body's density
  std::array<double, 3> spring{}, damper{}, rest{};
  std::array<bool, 3> held{};
  std::array<std::string, 3> motion;  // expressions of t; empty where not driven
  double angular_velocity = 0;        // at the start [rad/s]

  /// Mass [kg/m], inertia [kg m2/m] and centre of mass x, y [m] of the body.
  [[nodiscard]] std::vector<double> mass_and_inertia(const BodyScene& body, double spacing) const;
};

/// One row of particles on the mid-line of a shell; see ShellSection.
struct ShellScene {
  double thickness = 0;  // [m]
  bool closed = false;
  double shear_correction = 5.0 / 6.0;
  Hinge hinge = Hinge::growing;
  double shear_weight = 1;
  ShellViscosity viscosity;

  /// E' [Pa].
  [[nodiscard]] double modulus(const MaterialScene& material, Plane plane) const;
};

struct BodyScene {
  std::string name;
  Shape shape = Shape::box;
  Box box;                         // clamps, too; spacing and placement of the whole scene
  std::array<double, 2> centre{};  // of a disc [m]
  double radius = 0;               // of a disc [m]
  std::vector<Polygon> loops;      // of a polygon, holes after the first; the points of a polyline
  std::vector<double> points;      // x, y [m], volume [m2] of each particle of a point list
  MaterialScene material;
  std::optional<RigidScene> rigid;
  std::optional<ShellScene> shell;
  std::optional<FluidMaterial> fluid;
  RuptureLimits rupture;
  std::vector<std::array<double, 4>> cracks;  // of a solid, from the start: x0, y0, x1, y1 [m]
  std::array<std::string, 2> velocity;        // at the start, expressions of x and y; empty means 0

  /// Outline of what the scene asks for; empty for a point list.
  [[nodiscard]] std::vector<Polygon> outline(double spacing) const;
};

/// Which particles or which stretch of the contour a condition is about.
struct Place {
  std::size_t body = 0;
  bool every_body = false;                       // a region of a hold that names no body
  std::optional<Side> side;                      // of a box
  std::optional<std::array<double, 4>> stretch;  // the straight line from x0, y0 to x1, y1
  std::optional<std::array<double, 4>> region;   // the rectangle from x0, y0 to x1, y1
};

struct HoldScene {
  std::string name;  // for a watch; empty without
  Place place;
  std::array<bool, 2> component{true, true};
  bool rotation = true;                     // of shells
  std::array<std::string, 2> displacement;  // expressions of x, y and t; empty means 0
};

struct LoadScene {
  Place place;
  std::array<double, 2> force{};        // resultant [N/m], when neither of the others is given
  std::string ramp;                     // expression of t that scales `force`; empty means constant
  std::array<std::string, 2> traction;  // [Pa], expressions of x, y and t
  std::string pressure;                 // [Pa], expression of x, y and t
  double moment = 0;                    // [N m/m], on a shell, scaled by `ramp`

  /// Whether it may act on particles of a region where no stretch of the contour lies.
  [[nodiscard]] bool on_particles() const {
    return place.region && pressure.empty() && traction[0].empty() && traction[1].empty();
  }
};

struct WatchScene {
  std::string name;
  std::optional<std::array<double, 2>> point;   // reference position [m]
  std::optional<std::size_t> body;              // totals of one
  std::optional<std::array<double, 4>> region;  // what is now between x0, y0 and x1, y1
  std::optional<std::size_t> hold;              // what one of the scene's holds carries
};

enum class SteadyMethod { newton, relaxation };

/// How the forces received on the wet surface act through a time window.
enum class WindowLoad {
  mean,       // the mean of the values at the window's start and end, constant
  linear,     // from the value at the start to that at the end
  quadratic,  // through the value at the start of the window before as well; linear in the first
  received    // the value received, constant: for a partner that sends window means
};

struct SolidScene {
  std::vector<BodyScene> bodies;
  double spacing = 0;  // [m]
  double raised = 0;   // `particles_across` where it was made even, else 0
  Placement placement = Placement::on_contour;
  int stress_points = 0;  // per cell of four particles
  bool updated_lagrangian = false;
  bool periodic = false;
  bool contact = false;
  Clamp clamp = Clamp::line;
  LawName law = LawName::saint_venant_kirchhoff;
  Plane plane = Plane::strain;
  Order order = Order::linear;
  Kernel kernel = Kernel::cubic_spline;
  double smoothing_ratio = 0.95;
  double stabilisation = 0;
  double conservative_smoothing = 0;  // alpha
  double artificial_stress = 0;       // share of a tension, updated Lagrangian
  double hourglass_viscosity = 0;     // relaxation time in transits of a spacing, where plastic
  double contact_stiffness = 1;       // pressure per depth in spacings, in wave moduli
  double contact_modulus = 0;         // the same between rigid bodies [Pa]
  bool pinball = false;               // contact by impulses instead
  ContactNormals normals = ContactNormals::contour;
  double friction = 0;
  double penetration_correction = 0;
  bool variable_smoothing = true;  // of fluids
  double viscosity_linear = 0;
  double viscosity_quadratic = 0;
  double courant = 0.8;
  double damping = 0;
  std::array<double, 2> gravity{};
  std::array<bool, 2> held{};  // components of the displacement that stay zero
  std::vector<Side> wet;
  bool wet_contour = false;  // all of every contour that is not held
  std::vector<HoldScene> holds;
  std::vector<LoadScene> loads;
  std::vector<WatchScene> watches;
  SteadyMethod method = SteadyMethod::newton;
  EquilibriumSettings steady;
  bool accepts_unstable = false;  // equilibria that the body would leave at the least push
  WindowLoad window_load = WindowLoad::mean;
  Mode mode = Mode::steady;
  bool coupled = false;  // another participant acts on the wet surface
  // In the part of a fluid: the bodies meet the wet surface of the scene's solid.
  bool meets_surface = false;
  double window = 0;             // [s]
  double end_time = 0;           // [s]
  bool remove_isolated = false;  // particles without a link or, in solids, on one; else they fly on

  [[nodiscard]] bool plastic() const { return law == LawName::j2_plasticity; }
  /// Whether the volume of a body hardly gives way where its shape does; see Box::even.
  [[nodiscard]] bool nearly_incompressible(const BodyScene& body) const {
    return plane == Plane::strain && !body.rigid && !body.shell && !body.fluid &&
           (plastic() || body.material.poisson_ratio > 0.45);
  }
  [[nodiscard]] bool single_box() const {
    return bodies.size() == 1 && bodies.front().shape == Shape::box && !bodies.front().rigid;
  }
  [[nodiscard]] bool all_rigid() const;
  [[nodiscard]] bool shells() const;
  /// Whether anything can break.
  [[nodiscard]] bool breaks() const;
  /// Whether a point lies on the mid-line of a shell, up to half its thickness.
  [[nodiscard]] bool shell_at(const std::array<double, 2>& point) const;
  [[nodiscard]] bool fluids() const;
  /// Bodies of several kinds in one motion; see ImpactSolver.
  [[nodiscard]] bool impact() const { return pinball || meets_surface || fluids(); }
  [[nodiscard]] ElasticConstants constants(std::size_t body) const;
  [[nodiscard]] double wave_speed(std::size_t body) const;
  [[nodiscard]] double fastest_wave() const;
  /// Largest step by courant * spacing / wave speed [s].
  [[nodiscard]] double courant_step(const std::array<double, 2>& distance) const;
  [[nodiscard]] SolverOptions solver_options() const;
};

/// Notes every problem in `scene`; the result counts only when there are none.
SolidScene read_solid_scene(Scene& scene, const std::string& role);

// Parts of it: body_scene.cpp, shape_scene.cpp, rigid_scene.cpp, shell_scene.cpp, impact_scene.cpp,
// condition_scene.cpp.
void read_bodies(SceneTable& solid, SolidScene& result);
/// Keys of which a body has exactly one.
inline constexpr std::array<std::string_view, 6> kShapeKeys{"box",   "disc",   "polygon",
                                                            "image", "points", "polyline"};
/// All but pictures, see add_bodies. `spacing` [m], 0 where it is not known yet.
void read_shape(SceneTable& table, double spacing, BodyScene& body);
/// Adds a read body to the scene, or as copies of it those that its picture shows.
void add_bodies(SceneTable& table, SolidScene& scene, const BodyScene& body);
enum class Kind { deformable, rigid, shell, fluid };
Kind read_kind(SceneTable& table);
void read_shell(SceneTable& table, BodyScene& body);
/// `rupture` of a solid or a shell; `check_rupture` reads what becomes of isolated particles and notes what
/// does not go with it.
void read_rupture(SceneTable& table, BodyScene& body);
void check_rupture(SceneTable& solid, SolidScene& scene);
/// Notes what a scene with shells asks for that they do not have.
void check_shells(SceneTable& solid, const SolidScene& scene);
void read_fluid(SceneTable& table, double shared_density, BodyScene& body);
/// `[solid.contact]` with what bodies that meet by impulses need or do not have.
void read_contact(SceneTable& solid, SolidScene& scene);
void check_impact(SceneTable& solid, const SolidScene& scene);
/// `shared_density` is that of [solid], 0 when it has none.
void read_rigid(SceneTable& table, const SolidScene& scene, double shared_density, BodyScene& body);
void read_conditions(SceneTable& solid, SolidScene& result);
/// Sides of a box named under `key`; every slip is noted.
std::vector<Side> read_sides(SceneTable& solid, std::string_view key);
std::optional<Side> side_named(const std::string& word);
/// Notes what is wrong with an expression of x, y and t.
void check_expression(SceneTable& table, std::string_view key, const std::string& text);

/// Derived numbers, warnings, what is left out, memory and variant of a scene without problems.
Plan plan_of(const SolidScene& scene);
/// The part of shells.
void plan_shells(const SolidScene& scene, Plan& plan);
/// What a limit on shear strain means for the sections of shells.
void plan_shear_rupture(const SolidScene& scene, Plan& plan);
/// The part of bodies that meet by impulses.
void plan_impact(const SolidScene& scene, Plan& plan);

/// Of scenes whose bodies meet by impulses.
std::unique_ptr<Solver> make_impact_solver(const SolidScene& scene, const Body& body,
                                           const SolverOptions& options);

}  // namespace estuary::solid
