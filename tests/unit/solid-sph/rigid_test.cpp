// Rigid bodies on springs and dampers: exact motions, balances, rewinds, equilibria.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "outline_filling.hpp"
#include "participant_under_test.hpp"
#include "rigid_motion.hpp"
#include "solid.hpp"

namespace estuary::solid {
namespace {

constexpr double kPi = std::numbers::pi;

// Free and step-loaded oscillator, every kind of damping, against the closed solutions.
TEST(OscillatorStep, IsExactForEveryDamping) {
  const double m = 0.7, k = 12.0, g = 0.9;
  for (const double ratio : {0.0, 0.02, 0.5, 1.0, 3.0})
    for (const double dt : {1e-6, 0.01, 0.3, 5.0}) {
      const double w = std::sqrt(k / m), z = ratio, c = 2 * z * w * m;
      double e11 = 0, e12 = 0;
      if (z < 1) {
        const double wd = w * std::sqrt(1 - z * z), e = std::exp(-z * w * dt);
        e11 = e * (std::cos(wd * dt) + z * w / wd * std::sin(wd * dt));
        e12 = e * std::sin(wd * dt) / wd;
      } else if (z == 1) {
        e11 = std::exp(-w * dt) * (1 + w * dt);
        e12 = std::exp(-w * dt) * dt;
      } else {
        const double r = w * std::sqrt(z * z - 1), a = -z * w + r, b = -z * w - r;
        e11 = (a * std::exp(b * dt) - b * std::exp(a * dt)) / (a - b);
        e12 = (std::exp(a * dt) - std::exp(b * dt)) / (a - b);
      }
      const OscillatorStep step = oscillator_step(m, c, k, dt);
      EXPECT_NEAR(step.qq, e11, 1e-13) << ratio << " " << dt;
      EXPECT_NEAR(step.qv, e12, 1e-13) << ratio << " " << dt;
      EXPECT_NEAR(step.vq, -w * w * e12, 2e-12) << ratio << " " << dt;
      EXPECT_NEAR(step.qg * g, g / k * (1 - e11), 1e-13) << ratio << " " << dt;
      EXPECT_NEAR(step.vr, step.qg / dt, 1e-13);
    }
}
TEST(OscillatorStep, WithoutSpringAndDamperIsFreeFlight) {
  const OscillatorStep step = oscillator_step(2.0, 0, 0, 0.1);
  EXPECT_DOUBLE_EQ(step.qv, 0.1);
  EXPECT_DOUBLE_EQ(step.qg, 0.0025);
  EXPECT_DOUBLE_EQ(step.vg, 0.05);
  EXPECT_DOUBLE_EQ(step.vr, 0.025);
  EXPECT_EQ(step.vq, 0);
}
TEST(OscillatorStep, StaysFiniteForStiffSpringsAndDampers) {
  for (const double k : {1e-30, 1.0, 1e12})
    for (const double c : {0.0, 1e12}) {
      const OscillatorStep step = oscillator_step(1e-3, c, k, 1.0);
      for (const double e : {step.qq, step.qv, step.qg, step.vq, step.vv, step.vg, step.vr})
        EXPECT_TRUE(std::isfinite(e)) << k << " " << c;
      EXPECT_LE(std::abs(step.qq), 1 + 1e-4) << k << " " << c;
    }
}

TEST(AreaMoments, OfARectangleWithAHoleFarFromTheOrigin) {
  const auto box = [](double x0, double y0, double x1, double y1) {
    return Polygon{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
  };
  const AreaMoments whole = area_moments({box(1e3, 0, 1e3 + 4, 2)});
  EXPECT_NEAR(whole.area, 8, 1e-12);
  EXPECT_NEAR(whole.centroid[0], 1002, 1e-12);
  EXPECT_NEAR(whole.polar, 8.0 * (16 + 4) / 12, 1e-10);
  const AreaMoments holed = area_moments({box(0, 0, 4, 2), box(2, 0.5, 3, 1.5)});
  EXPECT_NEAR(holed.area, 7, 1e-13);
  EXPECT_NEAR(holed.centroid[0], (8 * 2 - 2.5) / 7, 1e-13);
  const double about_origin = 8.0 * (16 + 4) / 12 + 8 * (4 + 1) - (2.0 / 12 + 2.5 * 2.5 + 1);
  EXPECT_NEAR(holed.polar, about_origin - 7 * (std::pow(holed.centroid[0], 2) + 1), 1e-12);
}

struct RunningRigid {
  Solid solid;
  v1::Exchange brought;
  ProgressBoard board;
  std::filesystem::path folder;

  explicit RunningRigid(const std::string& text) {
    Scene scene = Scene::parse(text, "scene.toml");
    solid.configure(scene, "solid");
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    static int number = 0;
    folder = std::filesystem::temp_directory_path() /
             ("rigid-" + std::to_string(::getpid()) + "-" + std::to_string(++number));
    brought = solid.start({}, folder);
  }
  ~RunningRigid() { std::filesystem::remove_all(folder); }
  [[nodiscard]] v1::Exchange forces(double fx, double fy) const {
    v1::Exchange exchange;
    auto* forces = exchange.mutable_forces();
    forces->set_surface(brought.wet_surface().identity());
    const int nodes = brought.displacements().displacement_size() / 2;
    for (int k = 0; k < nodes; ++k) {
      forces->add_force(fx / nodes);
      forces->add_force(fy / nodes);
    }
    return exchange;
  }
  AdvanceResult step(std::uint64_t window, std::uint64_t iteration, double length,
                     const v1::Exchange& inputs) {
    return solid.advance({.number = window,
                          .iteration = iteration,
                          .mode = Mode::transient,
                          .time = length * static_cast<double>(window - 1),
                          .duration = length},
                         inputs, board);
  }
};

std::string scene(const std::string& solid, const std::string& mode = "transient") {
  return "title = \"rigid\"\ndimension = 2\n[coupling]\nmode = \"" + mode + "\"\n" +
         (mode == "transient" ? "window = 0.25\nend_time = 10\n" : "") + "[solid]\nsolver = \"solid-sph\"\n" +
         solid +
         "\n[[watch]]\nname = \"centre\"\nparticipant = \"solid\"\npoint = [0.3, 0.2]\n"
         "[[watch]]\nname = \"all\"\nparticipant = \"solid\"\n";
}
const char* const kDisc =
    "kind = \"rigid\"\ndisc = { centre = [0.3, 0.2], radius = 0.05 }\nspacing = 0.01\nwet = [\"contour\"]\n";

// Windows longer than a quarter of a period: the springs are integrated exactly.
TEST(Rigid, OscillatesExactlyOnItsSpringsAndKeepsItsEnergy) {
  RunningRigid run(
      scene(std::string(kDisc) +
            "mass = 2.0\nspring = [50.0, 80.0]\nrotation_spring = 0.02\nspring_rest = [0.0, 0.03]\n"
            "velocity = [\"0.1\", \"0\"]\nangular_velocity = 1.5\n"));
  const double inertia = 2.0 * 0.05 * 0.05 / 2;
  const double wx = std::sqrt(25.0), wy = std::sqrt(40.0), wr = std::sqrt(0.02 / inertia);
  const double energy = 0.5 * 2 * 0.01 + 0.5 * 80 * 0.0009 + 0.5 * inertia * 2.25;
  for (std::uint64_t window = 1; window <= 20; ++window) {
    const auto result = run.step(window, 1, 0.25, {});
    const double t = 0.25 * static_cast<double>(window);
    EXPECT_NEAR(value_of(result, "centre", "displacement_x"), 0.1 / wx * std::sin(wx * t), 1e-14);
    EXPECT_NEAR(value_of(result, "centre", "displacement_y"), 0.03 * (1 - std::cos(wy * t)), 1e-14);
    EXPECT_NEAR(value_of(result, "centre", "rotation"), 1.5 / wr * std::sin(wr * t), 1e-13);
    EXPECT_NEAR(value_of(result, "all", "total_energy"), energy, 1e-14);
    run.solid.accept();
  }
}

TEST(Rigid, AnswersADampedStepOfForceExactlyAfterRewinds) {
  RunningRigid run(
      scene(std::string(kDisc) +
            "mass = 2.0\nspring = [50.0, 50.0]\ndamper = [4.0, 0.0]\nheld = [\"y\", \"rotation\"]\n"
            "window_load = \"received\"\n"));
  const double g = 3.0, w = 5, z = 4.0 / (2 * 2.0 * 5), wd = w * std::sqrt(1 - z * z);
  double work = 0, viscous = 0, before = 0;
  for (std::uint64_t window = 1; window <= 12; ++window) {
    // Iterations with wrong forces leave no trace.
    run.step(window, 1, 0.25, run.forces(-50, 7));
    run.step(window, 2, 0.25, run.forces(1e3, 0));
    const auto result = run.step(window, 3, 0.25, run.forces(g, 0));
    run.solid.accept();
    const double t = 0.25 * static_cast<double>(window), e = std::exp(-z * w * t);
    const double exact = g / 50 * (1 - e * (std::cos(wd * t) + z * w / wd * std::sin(wd * t)));
    EXPECT_NEAR(value_of(result, "centre", "displacement_x"), exact, 1e-14);
    EXPECT_EQ(value_of(result, "centre", "displacement_y"), 0);
    EXPECT_NEAR(value_of(result, "all", "total_energy"), 0, 1e-13);
    work += g * (exact - before);
    before = exact;
    EXPECT_NEAR(value_of(result, "all", "external_work"), work, 1e-13);
    viscous = value_of(result, "all", "viscous_work");
  }
  EXPECT_GT(viscous, 0.3 * work);
}

// Disc on a spring under F sin(3 t), known at the ends of windows only: error of the place at t = 2 against
// the driven oscillator's closed solution, with what the solid takes the force to be in between.
TEST(Rigid, FollowsAForceInsideAWindowAtTheOrderOfItsInterpolation) {
  const auto error = [](const std::string& load, int windows) {
    RunningRigid run(scene(
        std::string(kDisc) +
        "mass = 2.0\nspring = [50.0, 50.0]\nheld = [\"y\", \"rotation\"]\nwindow_load = \"" + load + "\"\n"));
    const double h = 2.0 / windows, w = 5, rate = 3;
    AdvanceResult result;
    for (int n = 1; n <= windows; ++n) {
      const auto window = static_cast<std::uint64_t>(n);
      run.step(window, 1, h, run.forces(-20, 0));  // an iteration that is not accepted
      result = run.step(window, 2, h, run.forces(4 * std::sin(rate * h * n), 0));
      run.solid.accept();
    }
    const double exact = 4 / 2.0 / (w * w - rate * rate) * (std::sin(rate * 2) - rate / w * std::sin(w * 2));
    return std::abs(value_of(result, "centre", "displacement_x") - exact);
  };
  const auto order = [&](const std::string& load) { return std::log2(error(load, 40) / error(load, 80)); };
  EXPECT_NEAR(order("received"), 1, 0.3);
  EXPECT_NEAR(order("mean"), 2, 0.2);
  EXPECT_NEAR(order("linear"), 2, 0.2);
  EXPECT_NEAR(order("quadratic"), 3, 0.4);
}

TEST(Rigid, IsWeighedByItsDensityAndFalls) {
  RunningRigid run(
      scene("kind = \"rigid\"\npolygon = [[0.2, 0.1], [0.5, 0.1], [0.2, 0.4]]\nspacing = 0.02\n"
            "density = 1000\ngravity = [0, -9.81]\nangular_velocity = 2"));
  const double mass = 45, centre_x = 0.3, centre_y = 0.2;
  AdvanceResult result;
  for (std::uint64_t window = 1; window <= 4; ++window) {
    result = run.step(window, 1, 0.25, {});
    run.solid.accept();
  }
  EXPECT_NEAR(value_of(result, "centre", "displacement_y"), -0.5 * 9.81, 1e-12);
  EXPECT_NEAR(value_of(result, "centre", "rotation"), 2, 1e-12);
  EXPECT_NEAR(value_of(result, "all", "momentum_y"), -mass * 9.81, 1e-9);
  // b h (b^2 + h^2) / 36 for a right triangle, about its centroid.
  const double inertia = 1000 * 0.3 * 0.3 * (0.09 + 0.09) / 36;
  EXPECT_NEAR(value_of(result, "all", "angular_momentum"), inertia * 2 - mass * 9.81 * centre_x, 1e-9);
  EXPECT_NEAR(value_of(result, "all", "total_energy"), 0.5 * inertia * 4, 1e-9);
  EXPECT_GT(centre_y, 0);
}

TEST(Rigid, FollowsAMotionAndCountsItsWork) {
  RunningRigid run(scene(std::string(kDisc) +
                         "mass = 2.0\nspring = [50.0, 0.0]\ndamper = [3.0, 0.0]\n"
                         "motion = { x = \"0.1*sin(2*t)\", rotation = \"t^2\" }\nheld = [\"y\"]\n"));
  AdvanceResult result;
  for (std::uint64_t window = 1; window <= 8; ++window) {
    result = run.step(window, 1, 0.25, {});
    run.solid.accept();
  }
  EXPECT_NEAR(value_of(result, "centre", "displacement_x"), 0.1 * std::sin(4.0), 1e-15);
  EXPECT_NEAR(value_of(result, "centre", "velocity_x"), 0.2 * std::cos(4.0), 1e-5);
  EXPECT_NEAR(value_of(result, "centre", "rotation"), 4, 1e-15);
  EXPECT_NEAR(value_of(result, "centre", "angular_velocity"), 4, 1e-12);
  // The damper takes c times the integral of the velocity squared; the drive works for all of it, the jump of
  // the velocity at the start included.
  const double taken = 3.0 * 0.04 * (1 + std::sin(8.0) / 8);
  EXPECT_NEAR(value_of(result, "all", "viscous_work"), taken, 1e-4 * taken);
  EXPECT_NEAR(value_of(result, "all", "total_energy"), 0, 1e-13);
}

// Forces and motion of the wet contour see the same power, whatever the rotation.
TEST(Rigid, ForcesOnTheContourDoTheWorkTheBodyGains) {
  RunningRigid run(
      scene("kind = \"rigid\"\nbox = { from = [0.2, 0.1], to = [0.5, 0.3] }\nspacing = 0.02\n"
            "density = 500\nwet = [\"contour\"]\nwindow_load = \"received\"\n"));
  auto forces = run.forces(0, 0);
  auto* f = forces.mutable_forces()->mutable_force();
  for (int k = 0; k < f->size(); ++k) f->Set(k, std::sin(0.7 * k * k));
  for (std::uint64_t window = 1; window <= 8; ++window) {
    const auto result = run.step(window, 1, 0.25, forces);
    run.solid.accept();
    const double work = value_of(result, "all", "external_work");
    EXPECT_NEAR(value_of(result, "all", "kinetic_energy"), work, 1e-4 * work) << window;
  }
}

TEST(Rigid, SettlesWhereItsSpringsHoldTheLoad) {
  RunningRigid run(
      scene("kind = \"rigid\"\nbox = { from = [0.2, 0.1], to = [0.5, 0.3] }\nspacing = 0.02\n"
            "density = 500\nwet = [\"contour\"]\nspring = [200.0, 400.0]\nrotation_spring = 3.0\n"
            "gravity = [0, -10]\n",
            "steady"));
  auto forces = run.forces(40, 0);
  // A couple that turns with nothing: its lever is that of the turned body.
  auto* f = forces.mutable_forces()->mutable_force();
  const auto& nodes = run.brought.wet_surface().reference_positions();
  int left = 0, right = 0;
  for (int k = 0; k < nodes.size() / 2; ++k) {
    if (nodes[2 * k] < nodes[2 * left] ||
        (nodes[2 * k] == nodes[2 * left] && std::abs(nodes[2 * k + 1] - 0.2) < 1e-9))
      left = k;
    if (nodes[2 * k] > nodes[2 * right] ||
        (nodes[2 * k] == nodes[2 * right] && std::abs(nodes[2 * k + 1] - 0.2) < 1e-9))
      right = k;
  }
  f->Set(2 * left + 1, f->Get(2 * left + 1) - 5);
  f->Set(2 * right + 1, f->Get(2 * right + 1) + 5);
  const AdvanceResult result = run.solid.advance(
      {.number = 1, .iteration = 1, .mode = Mode::steady, .time = 0, .duration = 0}, forces, run.board);
  const double turn = value_of(result, "all", "reaction_moment");
  EXPECT_TRUE(std::isfinite(turn));
  EXPECT_NEAR(value_of(result, "all", "reaction_x"), -40, 1e-10);
  EXPECT_NEAR(value_of(result, "all", "reaction_y"), 500 * 0.06 * 10, 1e-9);
  // 3 q = 10 * 0.15 cos(q) + the moment of the even forces about the centroid, zero for these nodes.
  double q = 0.4;
  for (int round = 0; round < 50; ++round) q -= (3 * q - 1.5 * std::cos(q)) / (3 + 1.5 * std::sin(q));
  EXPECT_NEAR(value_of(result, "centre", "rotation"), q, 1e-9);
}

TEST(Rigid, GoesOnFromACheckpointToTheBit) {
  const std::string text = scene(
      std::string(kDisc) + "density = 100\nspring = [50.0, 80.0]\ndamper = [0.1, 0.2]\nangular_velocity = 1");
  RunningRigid first(text), second(text);
  for (std::uint64_t window = 1; window <= 3; ++window) {
    first.step(window, 1, 0.25, first.forces(0.3, 0.1));
    first.solid.accept();
  }
  first.solid.save(first.folder / "checkpoint");
  second.solid.load(first.folder / "checkpoint");
  const auto a = first.step(4, 1, 0.25, first.forces(1, 2)), b = second.step(4, 1, 0.25, second.forces(1, 2));
  for (const char* quantity :
       {"displacement_x", "displacement_y", "rotation", "velocity_x", "angular_velocity"})
    EXPECT_EQ(value_of(a, "centre", quantity), value_of(b, "centre", quantity)) << quantity;
}

TEST(Rigid, SaysWhenItsPositionIsNotFinite) {
  RunningRigid run(scene(std::string(kDisc) + "mass = 1e-9\n"));
  EXPECT_THROW(run.step(1, 1, 0.25, run.forces(1e308, 0)), Diverged);
  const auto again = run.step(1, 2, 0.25, run.forces(1e-9, 0));
  EXPECT_TRUE(std::isfinite(value_of(again, "centre", "displacement_x")));
}

TEST(Rigid, RefusesWhatItCannotMean) {
  const auto first_problem = [](const std::string& solid, const char* mode = "transient") {
    Solid participant;
    Scene parsed = Scene::parse(scene(solid, mode), "scene.toml");
    participant.configure(parsed, "solid");
    return parsed.problems().empty() ? std::string() : parsed.problems().front().message;
  };
  const std::string disc = kDisc;
  EXPECT_EQ(first_problem(disc + "mass = 1"), "");
  EXPECT_NE(first_problem(disc).find("density"), std::string::npos);
  EXPECT_NE(first_problem(disc + "mass = 1\ndensity = 2").find("either"), std::string::npos);
  EXPECT_NE(first_problem(disc + "mass = 1\nheld = [\"z\"]").find("held"), std::string::npos);
  EXPECT_NE(first_problem(disc + "mass = 1\nspring = [-1, 0]").find("negative"), std::string::npos);
  EXPECT_NE(first_problem(disc + "mass = 1\nclamped = [\"left\"]").find("held"), std::string::npos);
  EXPECT_NE(first_problem(disc + "mass = 1", "steady").find("unique equilibrium"), std::string::npos);
  EXPECT_NE(first_problem("disc = { centre = [0.3, 0.2], radius = 0.05 }\nspacing = 0.01\ndensity = 1\n"
                          "young_modulus = 1\npoisson_ratio = 0\nmass = 2")
                .find("rigid"),
            std::string::npos);
}

}  // namespace
}  // namespace estuary::solid
