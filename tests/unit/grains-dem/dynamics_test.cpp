// Time integration: orders, exact motions, going back, and what stops a run.
#include <gtest/gtest.h>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

// Overlap of two grains pressed into each other without damping: a cosine as long as they touch.
double oscillator_error(Integrator integrator, int terms, int corrections, std::uint64_t steps) {
  auto settings = test::free_space<2>(1e6, 1);
  settings.integrator = integrator;
  settings.gear_terms = terms;
  settings.gear_corrections = corrections;
  InitialGrains<2> grains;
  add_grain<2>(grains, {-0.009, 0}, {}, 0.01);
  add_grain<2>(grains, {0.009, 0}, {}, 0.01);
  const double omega = std::sqrt(1e6 / (0.5 * grains.mass[0]));
  Dynamics<2> dynamics(settings, grains, {});
  const double quarter = 0.25 * std::numbers::pi / omega;  // half the way out
  dynamics.advance(quarter, steps);
  const State<2>& s = dynamics.state();
  const double gap = std::abs(s.position[2] - s.position[0]);
  return std::abs(gap - (0.02 - 0.002 * std::cos(omega * quarter))) / 0.002;
}
TEST(Verlet, IsOfSecondOrder) {
  const double coarse = oscillator_error(Integrator::verlet, 5, 1, 10);
  const double fine = oscillator_error(Integrator::verlet, 5, 1, 20);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.1);
}
TEST(Gear, ThreeTermsAreOfSecondOrderMoreTermsOfHigher) {
  const double order3 =
      std::log2(oscillator_error(Integrator::gear, 3, 2, 20) / oscillator_error(Integrator::gear, 3, 2, 40));
  EXPECT_GT(order3, 1.7);
  for (const int terms : {4, 5, 6}) {
    const double coarse = oscillator_error(Integrator::gear, terms, 3, 20);
    const double fine = oscillator_error(Integrator::gear, terms, 3, 40);
    EXPECT_GT(std::log2(coarse / fine), 1.9) << terms;
    EXPECT_LT(fine, oscillator_error(Integrator::verlet, 5, 1, 40)) << terms;
  }
}

TEST(FreeFall, IsExactForEveryIntegrator) {
  for (const auto integrator : {Integrator::verlet, Integrator::gear}) {
    auto settings = test::free_space<3>(1e4, 1);
    settings.integrator = integrator;
    settings.gravity = {0, 0, -9.81};
    InitialGrains<3> grains;
    add_grain<3>(grains, {0, 0, 0}, {1, 2, 3}, 0.01, 1000, {1, 2, 3});
    Dynamics<3> dynamics(settings, grains, {});
    dynamics.advance(0.5, 500);
    const Vector<3> x = dynamics.unwrapped(0);
    EXPECT_NEAR(x[0], 0.5, 1e-11);
    EXPECT_NEAR(x[2], 1.5 - 0.5 * 9.81 * 0.25, 1e-11);
    EXPECT_NEAR(dynamics.energy_error(), 0, 1e-12);
  }
}

TEST(External, ForceAndTorqueActAndAreBooked) {
  auto settings = test::free_space<2>(1e4, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.set_external(std::vector<double>{2, 0}, std::vector<double>{0.01});
  dynamics.advance(0.1, 50);
  EXPECT_NEAR(dynamics.state().velocity[0], 2 * 0.1 / grains.mass[0], 1e-12);
  EXPECT_NEAR(dynamics.state().spin[0], 0.01 * 0.1 / grains.inertia[0], 1e-9);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-12);
}

TEST(Window, CanBeRepeatedBitForBit) {
  auto settings = test::free_space<2>(1e6, 0.7, 0.3);
  InitialGrains<2> grains = test::gas<2>(12, 0.2, settings);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.advance(0.01, 300);
  const auto start = dynamics.snapshot();
  dynamics.advance(0.01, 300);
  const State<2> first = dynamics.state();
  dynamics.restore(start);
  dynamics.advance(0.01, 300);
  EXPECT_EQ(dynamics.state().position, first.position);
  EXPECT_EQ(dynamics.state().velocity, first.velocity);
  EXPECT_EQ(dynamics.state().history, first.history);
}

TEST(Held, GrainsDoNotFeelForcesAndTheirWorkIsBooked) {
  auto settings = test::free_space<2>(1e6, 0.8);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {0, 0.5}, 0.01, 1000, {}, true);
  add_grain<2>(grains, {0, 0.025}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.advance(0.1, 20000);
  const State<2>& s = dynamics.state();
  const std::size_t held = s.identity[0] == 0 ? 0 : 1;
  EXPECT_NEAR(s.position[2 * held + 1], 0.05, 1e-12);
  EXPECT_GT(s.position[2 * (1 - held) + 1], 0.06);
  EXPECT_GT(s.ledger.given, 0);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.003);
}

TEST(Breakdown, NamesTheGrainThatFlewOff) {
  auto settings = test::free_space<2>(1e9, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  add_grain<2>(grains, {0.01, 0}, {}, 0.01);
  add_grain<2>(grains, {1, 0}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  try {
    dynamics.advance(1, 10);
    FAIL();
  } catch (const Breakdown& breakdown) {
    EXPECT_LT(breakdown.grain, 2u);
  }
}

// The elastic overlap of two grains that meet at `speed` is speed sqrt(m* / k): from the sum of their radii
// on they go through each other. No two that do so part in silence, however long the step.
template <int D>
void too_fast_is_refused(NormalLaw law) {
  for (const double steps : {10.0, 20.0, 100.0})
    for (const double offset : {0.0, 1e-6, 1e-4, 2e-4})  // across the way
      for (double share = 0.5; share < 20; share *= 1.07) {
        auto settings = test::free_space<D>(1e5, 1);
        settings.law.normal = law;
        if (law == NormalLaw::hertz) settings.constants.damping = 0;
        InitialGrains<D> grains;
        Vector<D> left{}, right{}, there{}, back{};
        left[0] = 0.4;
        right[0] = 0.4201;
        right[1] = offset;
        add_grain<D>(grains, left, {}, 0.01);
        add_grain<D>(grains, right, {}, 0.01);
        add_grain<D>(grains, Vector<D>{}, {}, 0.01);  // another, out of the way
        const double reduced = 0.5 * grains.mass[0], depth = 0.02 * share;
        // Of Hertz's law 1/2 m* v^2 = 2/5 k R*^(1/2) depth^(5/2).
        const double speed = law == NormalLaw::linear
                                 ? depth * std::sqrt(1e5 / reduced)
                                 : std::sqrt(0.8 * 1e5 * std::sqrt(0.005) * std::pow(depth, 2.5) / reduced);
        const double contact = law == NormalLaw::linear ? linear_contact_time(1e5, 1, reduced)
                                                        : hertz_contact_time(0.75e5, reduced, 0.005, speed);
        there[0] = 0.5 * speed;
        back[0] = -0.5 * speed;
        store<D>(grains.velocity.data(), 0, there);
        store<D>(grains.velocity.data(), 1, back);
        Dynamics<D> dynamics(settings, grains, {});
        const double time = 2 * contact;
        bool refused = false;
        std::string why;
        try {
          dynamics.advance(time, static_cast<std::uint64_t>(time / contact * steps));
        } catch (const Breakdown& breakdown) {
          refused = true;
          why = breakdown.what();
          const bool through = why.find("goes through grain 1") != std::string::npos;
          // Faster yet, one of them goes farther than its radius in a step, which is another message.
          EXPECT_TRUE(through ? breakdown.grain == 0 : 0.5 * speed * contact / steps > 0.01) << why;
        }
        if (share > 0.95 && share < 1) continue;  // would just turn back, but is refused
        EXPECT_EQ(refused, share > 1)
            << share << " diameters, " << steps << " steps, offset " << offset << ' ' << why;
      }
}

TEST(Breakdown, NamesTwoGrainsThatGoThroughEachOther) {
  too_fast_is_refused<2>(NormalLaw::linear);
  too_fast_is_refused<3>(NormalLaw::linear);
  too_fast_is_refused<3>(NormalLaw::hertz);
}

TEST(HalfOverlap, FliesApartWithTheEnergyStored) {
  auto settings = test::free_space<2>(1e6, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  add_grain<2>(grains, {0.01, 0}, {}, 0.01);  // half the diameter
  Dynamics<2> dynamics(settings, grains, {});
  const double stored = dynamics.energies().contacts;
  EXPECT_NEAR(stored, 0.5 * 1e6 * 1e-4, 1e-9);
  dynamics.advance(0.01, 2000);
  EXPECT_NEAR(dynamics.energies().translation, stored, 1e-3 * stored);
}

TEST(Lubrication, OfDiscsIsThatOfCylindersFromTheCutOffDownToTheRoughness) {
  const double viscosity = 0.1, cutoff = 1e-3, roughness = 1e-4, reduced = 0.01 * 0.02 / 0.03, approach = 0.3;
  const auto law = [&](double gap) {
    const auto part = [&](double h) { return std::pow(reduced / h, 1.5); };
    return 3 * std::numbers::sqrt2 * std::numbers::pi * viscosity * approach * (part(gap) - part(cutoff));
  };
  for (const auto& [gap, force] :
       {std::pair{5e-4, law(5e-4)}, {2e-4, law(2e-4)}, {1e-5, law(roughness)}, {1.1e-3, 0.0}}) {
    auto settings = test::free_space<2>(1e4, 1);
    settings.lubrication = {.viscosity = viscosity, .cutoff = cutoff, .minimum_gap = roughness, .margin = 0};
    InitialGrains<2> grains;
    add_grain<2>(grains, {0, 0}, {0.1, 0.5}, 0.01);  // what goes across does not count
    add_grain<2>(grains, {0.03 + gap, 0}, {-0.2, 0}, 0.02);
    Dynamics<2> dynamics(settings, grains, {});
    const std::size_t first = dynamics.state().identity[0] == 0 ? 0 : 1;
    EXPECT_NEAR(dynamics.state().force[2 * first], -force, 1e-9 * law(1e-4)) << gap;
    EXPECT_NEAR(dynamics.state().force[2 * (1 - first)], force, 1e-9 * law(1e-4)) << gap;
    EXPECT_NEAR(dynamics.state().force[2 * first + 1], 0, 1e-9 * law(1e-4)) << gap;
  }
}

TEST(Lubrication, SlowsAnApproachByReynoldsLaw) {
  // No inertia matters in the force itself: compare it with the formula at the first step.
  auto settings = test::free_space<3>(1e4, 1);
  settings.lubrication = {.viscosity = 0.1, .cutoff = 1e-3, .minimum_gap = 1e-5, .margin = 0};
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, 0}, {0.1, 0, 0}, 0.01);
  add_grain<3>(grains, {0.0202, 0, 0}, {-0.1, 0, 0}, 0.01);
  Dynamics<3> dynamics(settings, grains, {});
  const double force = 6 * std::numbers::pi * 0.1 * 0.2 * 0.005 * 0.005 * (1 / 2e-4 - 1 / 1e-3);
  const std::size_t first = dynamics.state().identity[0] == 0 ? 0 : 1;
  EXPECT_NEAR(dynamics.state().force[3 * first], -force, 1e-9);
  EXPECT_NEAR(dynamics.state().force[3 * (1 - first)], force, 1e-9);
  dynamics.advance(0.01, 20000);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-3);
}

template <int D>
Wall<D> floor_at(double height) {
  Wall<D> wall;
  wall.name = "floor";
  wall.point[D - 1] = height;
  wall.normal[D - 1] = 1;
  return wall;
}

// What resists the approach to a plane: `resistance` over speed, and its integral from `gap` up to `start`.
template <int D>
struct FilmAtPlane {
  double viscosity, cutoff, radius;
  [[nodiscard]] double resistance(double gap) const {
    if constexpr (D == 2)
      return 3 * std::numbers::sqrt2 * std::numbers::pi * viscosity *
             (std::pow(radius / gap, 1.5) - std::pow(radius / cutoff, 1.5));
    else
      return 6 * std::numbers::pi * viscosity * radius * radius * (1 / gap - 1 / cutoff);
  }
  [[nodiscard]] double integral(double gap, double start) const {
    if constexpr (D == 2)
      return 3 * std::numbers::sqrt2 * std::numbers::pi * viscosity *
             (2 * std::pow(radius, 1.5) * (1 / std::sqrt(gap) - 1 / std::sqrt(start)) -
              (start - gap) * std::pow(radius / cutoff, 1.5));
    else
      return 6 * std::numbers::pi * viscosity * radius * radius *
             (std::log(start / gap) - (start - gap) / cutoff);
  }
};

template <int D>
void film_at_plane_is_exact() {
  const FilmAtPlane<D> film{.viscosity = 0.1, .cutoff = 1e-3, .radius = 0.01};
  const double roughness = 1e-4, approach = 0.3;
  for (const double margin : {0.0, 3e-4})
    for (const auto& [gap, force] : {std::pair{9e-4, approach * film.resistance(9e-4)},
                                     {5e-4, approach * film.resistance(5e-4)},
                                     {1e-5, approach * film.resistance(roughness)},
                                     {1.1e-3, 0.0}}) {
      auto settings = test::free_space<D>(0, 1);  // where the margin touches nothing but the film acts
      settings.lubrication = {
          .viscosity = film.viscosity, .cutoff = film.cutoff, .minimum_gap = roughness, .margin = margin};
      settings.skin = 1e-6;
      Vector<D> x{}, v{};
      x[0] = 0.2;
      x[D - 1] = 0.5 + film.radius + gap;
      v[0] = 0.5;  // along the plane does not count
      v[D - 1] = -0.2;
      InitialGrains<D> grains;
      add_grain<D>(grains, x, v, film.radius + margin);
      Wall<D> wall = floor_at<D>(0.5);
      wall.velocity[D - 1] = 0.1;
      Dynamics<D> dynamics(settings, grains, {wall});
      const double tolerance = 1e-9 * film.resistance(roughness);
      EXPECT_NEAR(dynamics.state().force[D - 1], force, tolerance) << gap;
      EXPECT_NEAR(dynamics.state().force[0], 0, tolerance) << gap;
      EXPECT_NEAR(dynamics.wall_force(0)[D - 1], -force, tolerance) << gap;
      // About a pivot at the origin, by the arm 0.2.
      EXPECT_NEAR(dynamics.wall_torque(0)[D == 2 ? 0 : 1], (D == 2 ? -0.2 : 0.2) * force, 0.2 * tolerance)
          << gap;
    }
}

TEST(Lubrication, AtAPlaneIsThatOfTheGrainsRadius) {
  film_at_plane_is_exact<2>();
  film_at_plane_is_exact<3>();
}

// The momentum of a grain pressed against a plane by a constant force is what the force gave less the
// integral of the film's resistance over the gap, which in a viscous fluid is all that resists: of spheres
// without cut-off h = h_0 exp(-F t / (6 pi mu R^2)).
template <int D>
void sinks_to_a_plane() {
  const double start = 1e-3, end = 0.05;
  const FilmAtPlane<D> film{.viscosity = 10, .cutoff = 1, .radius = 0.01};
  auto settings = test::free_space<D>(1e4, 1);
  settings.lubrication = {
      .viscosity = film.viscosity, .cutoff = film.cutoff, .minimum_gap = 1e-6, .margin = 0};
  settings.gravity[D - 1] = D == 2 ? -600 : -200;
  Vector<D> x{};
  x[0] = 0.2;
  x[D - 1] = film.radius + start;
  InitialGrains<D> grains;
  add_grain<D>(grains, x, {}, film.radius);
  Dynamics<D> dynamics(settings, grains, {floor_at<D>(0)});
  const double mass = grains.mass[0], force = -mass * settings.gravity[D - 1];
  const std::uint64_t steps = 20000;
  double given = 0.5 * dynamics.wall_force(0)[D - 1];
  dynamics.advance(end, steps, [&](std::uint64_t step) {
    given += (step < steps ? 1 : 0.5) * dynamics.wall_force(0)[D - 1];
  });
  const double gap = dynamics.unwrapped(0)[D - 1] - film.radius, speed = -dynamics.state().velocity[D - 1];
  EXPECT_LT(gap, 0.3 * start);
  EXPECT_NEAR(film.integral(gap, start), force * end - mass * speed, 1e-4 * force * end);
  EXPECT_LT(mass * speed, 1e-3 * force * end);  // as good as without inertia
  if (D == 3) {
    EXPECT_NEAR(gap, start * std::exp(-force * end / (6 * std::numbers::pi * 10 * 1e-4)), 2e-3 * gap);
  }
  EXPECT_NEAR(-given * end / steps, force * end - mass * speed, 1e-10 * force * end);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-4);
}

TEST(Lubrication, GrainSinksToAPlaneAsReynoldsEquationSays) {
  sinks_to_a_plane<2>();
  sinks_to_a_plane<3>();
}

// It takes the plane's velocity without touching it: half the plane's work goes into motion, half into heat.
TEST(Lubrication, MovingPlanePushesAGrainThroughTheFilm) {
  const double start = 5e-4, push = 0.2;
  const FilmAtPlane<3> film{.viscosity = 1, .cutoff = 1e-3, .radius = 0.01};
  auto settings = test::free_space<3>(1e4, 1);
  settings.lubrication = {
      .viscosity = film.viscosity, .cutoff = film.cutoff, .minimum_gap = 1e-6, .margin = 0};
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, film.radius + start}, {}, film.radius);
  Dynamics<3> dynamics(settings, grains, {floor_at<3>(0)});
  dynamics.wall_velocity = [&](std::size_t, double) { return Vector<3>{0, 0, push}; };
  dynamics.advance(0.1, 20000);
  const State<3>& s = dynamics.state();
  EXPECT_NEAR(s.velocity[2], push, 1e-6);
  const double gap = s.position[2] - dynamics.walls()[0].point[2] - film.radius;
  const double momentum = grains.mass[0] * push;
  EXPECT_NEAR(film.integral(gap, start), momentum, 2e-3 * momentum);
  EXPECT_NEAR(s.ledger.given, momentum * push, 2e-3 * momentum * push);
  EXPECT_NEAR(s.ledger.normal, 0.5 * momentum * push, 2e-3 * momentum * push);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-3);
}

}  // namespace
}  // namespace estuary::grains
