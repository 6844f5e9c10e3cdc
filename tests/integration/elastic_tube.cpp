// A one-dimensional elastic tube as two participants, the coupler's benchmark: incompressible flow on one
// side, the tube's cross-section as a function of the pressure on the other. Nothing but the iteration costs
// anything.
//
// `intervals` = 100 by default; `own_surface = true` gives the fluid a wet surface of its own, so that both
// sides may have other nodes and the coupler has to map between them. `longest_window` [s]: with longer
// windows the fluid finds no solution.
//
//   fluid  d(a)/dt + d(a v)/dx = 0,  d(a v)/dt + d(a v^2)/dx + a dp/dx = 0, implicit Euler, 101 nodes on L =
//   10,
//          inflow v = 10 + 3 sin(10 pi t), non-reflecting outflow (Degroote et al. 2008)
//   solid  a = a_0 ((p_0 - 2 c^2) / (p - 2 c^2))^2,  c^2 = E / (2 r_0),  a_0 = 1, E = 10^4 (Hookean wall)
//
// Wet nodes lie along x; their displacement along y is a - a_0. The coupler makes nodal forces of the
// pressures, which the solid turns back into pressures exactly.
#include <Eigen/Dense>
#include <Eigen/SparseLU>
#include <array>
#include <cmath>
#include <numbers>

#include "checkpoint.hpp"
#include "serve.hpp"
#include "wet_surface.hpp"

namespace {

using namespace estuary;

constexpr double length = 10.0;
constexpr double young_modulus = 1e4;
constexpr std::uint64_t surface_identity = 1010;
constexpr std::uint64_t own_surface_identity = 2020;
// Before the first request.
int nodes = 101;
double dx = length / 100;
const double radius = 1 / std::sqrt(std::numbers::pi);
const double wave_speed = std::sqrt(young_modulus / 2 / radius);

using Vector = Eigen::VectorXd;

double inflow(double t) {
  return 10 + 3 * std::sin(10 * std::numbers::pi * t);
}

struct Flow {
  Vector velocity;
  Vector pressure;
};

// Residuals of momentum (first half) and continuity (second half) for the new state.
Vector residual(const Flow& now, const Flow& before, const Vector& a, const Vector& a_before, double dt,
                double t) {
  const double stabilisation = 1 / (inflow(0) + dx / dt);
  const Vector& v = now.velocity;
  const Vector& p = now.pressure;
  Vector r = Vector::Zero(2 * nodes);
  for (int i = 1; i < nodes - 1; ++i) {
    const double right = 0.5 * (a[i] + a[i + 1]);
    const double left = 0.5 * (a[i - 1] + a[i]);
    const double flux_right = 0.5 * right * (v[i] + v[i + 1]);
    const double flux_left = 0.5 * left * (v[i - 1] + v[i]);
    // Upwind momentum, as in the reference scheme.
    r[i] = (v[i] * a[i] - before.velocity[i] * a_before[i]) * dx / dt + flux_right * v[i] -
           flux_left * v[i - 1] + 0.5 * (right * (p[i + 1] - p[i]) + left * (p[i] - p[i - 1]));
    r[nodes + i] = (a[i] - a_before[i]) * dx / dt + flux_right - flux_left -
                   stabilisation * (p[i + 1] - 2 * p[i] + p[i - 1]);
  }
  r[0] = v[0] - inflow(t);
  r[nodes] = p[0] - 2 * p[1] + p[2];
  r[nodes - 1] = v[nodes - 1] - 2 * v[nodes - 2] + v[nodes - 3];
  const double root = std::sqrt(wave_speed * wave_speed - before.pressure[nodes - 1] / 2) -
                      (v[nodes - 1] - before.velocity[nodes - 1]) / 4;
  r[2 * nodes - 1] = p[nodes - 1] - 2 * (wave_speed * wave_speed - root * root);
  return r;
}

// Newton's method; the Jacobian has few diagonals around each of four blocks, so columns seven apart are
// differentiated together.
Flow solve(const Flow& before, const Vector& a, const Vector& a_before, double dt, double t) {
  Flow now = before;
  const auto shifted = [&](int block, int first, double step) {
    Flow moved = now;
    Vector& values = block == 0 ? moved.velocity : moved.pressure;
    for (int j = first; j < nodes; j += 7) values[j] += step;
    return moved;
  };
  for (int k = 0; k < 30; ++k) {
    const Vector r = residual(now, before, a, a_before, dt, t);
    std::vector<Eigen::Triplet<double>> entries;
    for (int block = 0; block < 2; ++block) {
      for (int first = 0; first < 7; ++first) {
        constexpr double step = 1e-6;
        const Vector change = (residual(shifted(block, first, step), before, a, a_before, dt, t) - r) / step;
        for (int j = first; j < nodes; j += 7) {
          for (int i = std::max(0, j - 3); i <= std::min(nodes - 1, j + 3); ++i) {
            for (const int row : {i, nodes + i}) {
              if (change[row] != 0) entries.emplace_back(row, block * nodes + j, change[row]);
            }
          }
        }
      }
    }
    Eigen::SparseMatrix<double> jacobian(2 * nodes, 2 * nodes);
    jacobian.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SparseLU<Eigen::SparseMatrix<double>> factors(jacobian);
    if (factors.info() != Eigen::Success) break;
    const Vector step = factors.solve(r);
    now.velocity -= step.head(nodes);
    now.pressure -= step.tail(nodes);
    if (!std::isfinite(step.norm())) break;
    if (step.norm() < 1e-11 * (now.velocity.norm() + now.pressure.norm())) return now;
  }
  throw NotConverged("the flow in the tube has no solution", "a smaller window");
}

class TubeParticipant final : public Participant {
public:
  Identity identity() const override {
    return {
        "elastic-tube", "1", {"fluid", "solid"}, {"transient", "wet-surface", "rewind", "checkpoint"}, {2}};
  }
  Plan configure(Scene& scene, const std::string& role) override {
    role_ = role;
    SceneTable table = scene.root().table(role);
    table.leave_to_others({"solver", "connect", "threads"});
    nodes = static_cast<int>(table.integer_or("intervals", 100, 10, 100'000)) + 1;
    dx = length / (nodes - 1);
    own_surface_ = role == "fluid" && table.boolean_or("own_surface", false);
    longest_window_ = role == "fluid" ? table.number_or("longest_window", 1e9, Range::positive()) : 1e9;
    table.refuse_unknown_keys();
    return {};
  }
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) override {
    area_before_ = area_ = Vector::Ones(nodes);
    flow_before_ = flow_ = {Vector::Constant(nodes, inflow(0)), Vector::Zero(nodes)};
    v1::Exchange brought;
    if (role_ == "fluid" && !own_surface_) {
      surface_ = initial.wet_surface();
      check_wet_surface(surface_);
      if (node_count(surface_) != static_cast<std::size_t>(nodes))
        throw BadInput("wet_surface",
                       "has another number of nodes; own_surface = true brings one of its own");
      return brought;
    }
    surface_.set_identity(own_surface_ ? own_surface_identity : surface_identity);
    surface_.set_dimension(2);
    for (int i = 0; i < nodes; ++i) {
      surface_.add_reference_positions(i * dx);
      surface_.add_reference_positions(0.0);
      if (i == 0) continue;
      surface_.add_connectivity(static_cast<std::uint32_t>(i - 1));
      surface_.add_connectivity(static_cast<std::uint32_t>(i));
    }
    *brought.mutable_wet_surface() = surface_;
    if (role_ == "solid") set_displacements(Vector::Zero(nodes), *brought.mutable_displacements());
    return brought;
  }
  std::optional<double> window_step() const override { return 0.0; }
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override {
    if (progress.stop_requested()) throw Interrupted();
    AdvanceResult result;
    if (role_ == "fluid") {
      check_displacements(inputs.displacements(), surface_);
      for (int i = 0; i < nodes; ++i) area_[i] = 1 + inputs.displacements().displacement(2 * i + 1);
      if (!(area_.minCoeff() > 0)) throw Diverged("area", "the tube is closed", "more relaxation");
      if (window.duration > longest_window_)
        throw NotConverged("the flow in the tube has no solution", "a smaller window");
      flow_ = solve(flow_before_, area_, area_before_, window.duration, window.time + window.duration);
      result.outputs.mutable_pressures()->set_surface(surface_.identity());
      for (int i = 0; i < nodes; ++i) result.outputs.mutable_pressures()->add_pressure(flow_.pressure[i]);
      result.watches.push_back(
          {"flow", {{"pressure", flow_.pressure[0]}, {"outflow", flow_.velocity[nodes - 1]}}});
    } else {
      check_forces(inputs.forces(), surface_);
      const Vector pressure = pressure_from(inputs.forces());
      const double square = wave_speed * wave_speed;
      const Vector area = (2 * square / (2 * square - pressure.array())).square().matrix();
      if (!(pressure.maxCoeff() < 2 * square))
        throw Diverged("pressure", "the tube bursts", "more relaxation");
      auto& message = *result.outputs.mutable_displacements();
      set_displacements(area - Vector::Ones(nodes), message);
      for (int i = 0; i < nodes; ++i)
        message.set_velocity(2 * i + 1, (area[i] - area_before_[i]) / window.duration);
      area_ = area;
    }
    ++result.work.steps;
    return result;
  }
  void accept() override {
    flow_before_ = flow_;
    area_before_ = area_;
  }
  void save(const std::filesystem::path& file) override {
    CheckpointWriter writer(file);
    for (const auto& [name, values] : state()) writer.add(name, {values->data(), size_of(*values)});
    writer.commit();
  }
  void load(const std::filesystem::path& file) override {
    const CheckpointReader reader(file);
    for (const auto& [name, values] : state()) reader.read(name, {values->data(), size_of(*values)});
    flow_ = flow_before_;
    area_ = area_before_;
  }
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }

private:
  std::array<std::pair<const char*, Vector*>, 3> state() {
    return {{{"velocity", &flow_before_.velocity},
             {"pressure", &flow_before_.pressure},
             {"area", &area_before_}}};
  }
  static std::size_t size_of(const Vector& values) { return static_cast<std::size_t>(values.size()); }
  // The coupler's consistent load: the y component of a node's force is minus the mass matrix times the
  // pressures, whatever the displacement along y.
  static Vector pressure_from(const v1::NodalForces& forces) {
    std::vector<Eigen::Triplet<double>> entries;
    Vector right(nodes);
    for (int i = 0; i < nodes; ++i) {
      right[i] = -forces.force(2 * i + 1);
      const bool end = i == 0 || i == nodes - 1;
      entries.emplace_back(i, i, dx * (end ? 2.0 : 4.0) / 6);
      if (i > 0) entries.emplace_back(i, i - 1, dx / 6);
      if (i < nodes - 1) entries.emplace_back(i, i + 1, dx / 6);
    }
    Eigen::SparseMatrix<double> mass(nodes, nodes);
    mass.setFromTriplets(entries.begin(), entries.end());
    return Eigen::SparseLU<Eigen::SparseMatrix<double>>(mass).solve(right);
  }
  static void set_displacements(const Vector& values, v1::Displacements& message) {
    message.set_surface(surface_identity);
    for (int i = 0; i < nodes; ++i) {
      message.add_displacement(0);
      message.add_displacement(values[i]);
    }
    message.mutable_velocity()->Resize(2 * nodes, 0.0);
  }

  std::string role_;
  v1::WetSurface surface_;
  Flow flow_before_;
  Flow flow_;
  Vector area_before_;
  Vector area_;
  bool own_surface_ = false;
  double longest_window_ = 1e9;
};

}  // namespace

int main(int argc, char** argv) {
  return serve(argc, argv, std::make_unique<TubeParticipant>());
}
