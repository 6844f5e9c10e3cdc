// Two masses between two walls, joined by three springs, as two participants: the solid is the left mass with
// the spring to its wall, the fluid the right mass with the spring to its wall and the one between them.
//
//   m u1'' = -k u1 + k12 (u2 - u1),   m u2'' = -k u2 - k12 (u2 - u1),   m = 1, k = 4 pi^2, k12 = 16 pi^2
//   from rest at u1 = 1, u2 = 0:      u1, u2 = (cos 2 pi t +- cos 6 pi t) / 2
//
// Each takes `steps` Runge-Kutta steps (fourth order) in a window and interpolates its input in time as
// `interpolation` says ("hermite": the displacement with its velocity, the solid's force quadratically).
// The wet surface is one upright segment of length 1, so that a pressure p is a force p along x.
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "checkpoint.hpp"
#include "serve.hpp"
#include "wet_surface.hpp"
#include "window_interpolation.hpp"

namespace {

using namespace estuary;

constexpr std::uint64_t surface_identity = 3;
constexpr double wall_spring = 4 * std::numbers::pi * std::numbers::pi;
constexpr double middle_spring = 4 * wall_spring;

struct State {
  double place = 0;
  double velocity = 0;
};

class OscillatorParticipant final : public Participant {
public:
  Identity identity() const override {
    return {"oscillator", "1", {"fluid", "solid"}, {"transient", "wet-surface", "rewind", "checkpoint"}, {2}};
  }
  Plan configure(Scene& scene, const std::string& role) override {
    left_ = role == "solid";
    SceneTable table = scene.root().table(role);
    table.leave_to_others({"solver", "connect", "threads"});
    steps_ = static_cast<int>(table.integer_or("steps", 10, 1, 1'000'000));
    constexpr std::array<std::string_view, 4> names = {"linear", "constant", "quadratic", "hermite"};
    const std::string name = table.choice("interpolation", names);
    hermite_ = name == "hermite" && !left_;
    kind_ = name == "hermite"                                            ? InterpolationInTime::quadratic
            : std::find(names.begin(), names.end(), name) == names.end() ? InterpolationInTime::linear
                                                                         : interpolation_named(name);
    table.refuse_unknown_keys();
    return {};
  }
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) override {
    accepted_ = now_ = {left_ ? 1.0 : 0.0, 0.0};
    // The force on the left mass at the start, and the place of the left mass for the right one.
    input_.emplace(kind_, std::vector<double>{left_ ? -middle_spring : 1.0});
    input_velocity_ = 0;
    if (!left_) {
      surface_ = initial.wet_surface();
      check_wet_surface(surface_);
      return {};
    }
    v1::Exchange brought;
    surface_.set_identity(surface_identity);
    surface_.set_dimension(2);
    for (const double value : {0.0, 0.0, 0.0, 1.0}) surface_.add_reference_positions(value);
    for (const std::uint32_t node : {0U, 1U}) surface_.add_connectivity(node);
    *brought.mutable_wet_surface() = surface_;
    fill(*brought.mutable_displacements());
    return brought;
  }
  std::optional<double> window_step() const override { return 0.0; }

  AdvanceResult advance(const Window& window, const v1::Exchange& inputs,
                        ProgressBoard& /*progress*/) override {
    const double start_input = input_->at(0, 0.0);
    double end = 0;
    if (left_) {
      check_forces(inputs.forces(), surface_);
      end = inputs.forces().force(0) + inputs.forces().force(2);
    } else {
      check_displacements(inputs.displacements(), surface_);
      end = inputs.displacements().displacement(0);
      end_velocity_ = inputs.displacements().velocity(0);
    }
    const std::array<double, 1> values = {end};
    input_->set_end(values, window.duration);
    const auto input_at = [&](double s) {
      return hermite_ ? hermite(start_value_.value_or(start_input), input_velocity_, end, end_velocity_,
                                window.duration, s)
                      : input_->at(0, s);
    };
    const auto rate = [&](const State& state, double s) {
      const double force = left_ ? input_at(s) : middle_spring * (input_at(s) - state.place);
      return State{state.velocity, force - wall_spring * state.place};
    };
    const auto after = [](const State& state, const State& change, double dt) {
      return State{state.place + dt * change.place, state.velocity + dt * change.velocity};
    };
    now_ = accepted_;
    const double dt = window.duration / steps_;
    for (int k = 0; k < steps_; ++k) {
      const double s = static_cast<double>(k) / steps_, half = (k + 0.5) / steps_, full = (k + 1.0) / steps_;
      const State a = rate(now_, s);
      const State b = rate(after(now_, a, dt / 2), half);
      const State c = rate(after(now_, b, dt / 2), half);
      const State d = rate(after(now_, c, dt), full);
      now_.place += dt / 6 * (a.place + 2 * b.place + 2 * c.place + d.place);
      now_.velocity += dt / 6 * (a.velocity + 2 * b.velocity + 2 * c.velocity + d.velocity);
    }
    end_value_ = end;
    AdvanceResult result;
    result.work.steps = work_ += static_cast<std::uint64_t>(steps_);
    if (left_) {
      fill(*result.outputs.mutable_displacements());
    } else {
      auto& pressures = *result.outputs.mutable_pressures();
      pressures.set_surface(surface_.identity());
      for (int node = 0; node < 2; ++node) pressures.add_pressure(middle_spring * (now_.place - end));
    }
    const double t = window.time + window.duration;
    const double sum = std::cos(2 * std::numbers::pi * t), change = std::cos(6 * std::numbers::pi * t);
    result.watches.push_back(
        {left_ ? "left" : "right",
         {{"place", now_.place},
          {"velocity", now_.velocity},
          {"error", std::abs(now_.place - 0.5 * (left_ ? sum + change : sum - change))}}});
    return result;
  }
  void accept() override {
    accepted_ = now_;
    input_->accept();
    start_value_ = end_value_;
    input_velocity_ = end_velocity_;
  }
  void save(const std::filesystem::path& file) override {
    CheckpointWriter writer(file);
    writer.add("input", input_->save());
    writer.add("state", std::vector<double>{accepted_.place, accepted_.velocity, start_value_.value_or(0),
                                            input_velocity_});
    writer.add("begun", static_cast<std::uint64_t>(start_value_.has_value()));
    writer.add("work", work_);
    writer.commit();
  }
  void load(const std::filesystem::path& file) override {
    const CheckpointReader reader(file);
    input_->restore(reader.read_all("input"));
    std::array<double, 4> values{};
    reader.read("state", values);
    accepted_ = now_ = {values[0], values[1]};
    start_value_.reset();
    if (reader.read_count("begun") == 1) start_value_ = values[2];
    input_velocity_ = values[3];
    work_ = reader.read_count("work");
  }
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }

private:
  // The displacement is the place: the surface's reference is where the spring to the wall is slack.
  void fill(v1::Displacements& message) const {
    message.set_surface(surface_identity);
    for (int node = 0; node < 2; ++node) {
      for (const double value : {now_.place, 0.0}) message.add_displacement(value);
      for (const double value : {now_.velocity, 0.0}) message.add_velocity(value);
    }
  }

  bool left_ = false;
  bool hermite_ = false;
  int steps_ = 10;
  InterpolationInTime kind_ = InterpolationInTime::linear;
  v1::WetSurface surface_;
  State accepted_;
  State now_;
  std::optional<WindowInterpolation> input_;
  std::optional<double> start_value_;  // of the input, once a window was accepted
  double end_value_ = 0;
  double input_velocity_ = 0;
  double end_velocity_ = 0;
  std::uint64_t work_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  return estuary::serve(argc, argv, std::make_unique<OscillatorParticipant>());
}
