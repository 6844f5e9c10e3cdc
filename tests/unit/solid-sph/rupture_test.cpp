// Solid bodies that break: when, what is kept, and how a run goes on from there.
#include <gtest/gtest.h>

#include <omp.h>

#include <cmath>

#include "bodies.hpp"
#include "running_scene.hpp"
#include "rupture.hpp"
#include "shell.hpp"

namespace estuary::solid {
namespace {

struct Breaking : test::RunningScene {
  Breaking(const std::string& text, double window)
      : RunningScene(
            "dimension = 2\n[coupling]\nmode = \"transient\"\nwindow = 1e-5\nend_time = 1\n[[watch]]\n"
            "name = \"all\"\nparticipant = \"solid\"\n[solid]\ndensity = 1000\nyoung_modulus = 1e9\n"
            "poisson_ratio = 0.3\n" +
                text,
            window) {}
  double operator[](const std::string& quantity) const { return value("all", quantity); }
};

// Between grips that go apart by 0.05 m/s each; Rivlin & Thomas: it runs at G H / M = (38.5 um)^2.
std::string cracked_strip(int rows) {
  return "law = \"neo_hooke\"\ndamping = 2000\nspacing = " + std::to_string(0.04 / rows) + R"(
rupture = { energy = 100.0, crack = [[-0.01, 0.02], [0.0666, 0.02]] }
box = { from = [0.0, 0.0], to = [0.2, 0.04] }
[[solid.hold]]
side = "top"
displacement = ["0", "0.05 * t"]
[[solid.hold]]
side = "bottom"
displacement = ["0", "-0.05 * t"]
)";
}

TEST(Rupture, ACrackRunsWhenItSetsItsEnergyFreeWhateverTheSpacing) {
  for (const int rows : {11, 15}) {
    Breaking strip(cracked_strip(rows), 1e-5);
    strip.run(1);
    const double before = strip["broken_links"];
    EXPECT_GT(before, 0);
    strip.run(68);  // to 0.9 of the displacement
    EXPECT_EQ(strip["broken_links"], before) << rows;
    strip.run(12);  // 1.05
    EXPECT_GT(strip["broken_links"], before) << rows;
    EXPECT_NEAR(strip["total_energy"] / strip["external_work"], 0, 0.02);
  }
}

// Two halves that fly apart; what is between them has to break.
std::string torn(const std::string& law) {
  return law + R"(
box = { from = [-0.1, 0.0], to = [0.1, 0.05] }
spacing = 0.01
velocity = ["x < 0 ? -60 : 60", "20 * x / 0.1"]
)";
}

TEST(Rupture, KeepsMomentaAndBalancesEnergy) {
  for (const char* law : {"law = \"neo_hooke\"\nrupture = { stretch = 0.05 }",
                          "law = \"j2_plasticity\"\nyield_stress = 5e6\nrupture = { plastic_strain = 0.1 }",
                          "law = \"j2_plasticity\"\nyield_stress = 5e6\nrupture = { energy = 5e3 }"}) {
    Breaking body(torn(law) + "courant = 0.3\n", 2e-5);
    body.run(1);
    const double energy = body["total_energy"], spin = body["angular_momentum"], x = body["momentum_x"];
    body.run(24);
    EXPECT_GT(body["broken_links"], 4) << law;
    EXPECT_GT(body["fracture_work"], 0) << law;
    EXPECT_NEAR(body["momentum_x"], x, 1e-9) << law;
    EXPECT_NEAR(body["momentum_y"], 0, 1e-9) << law;
    EXPECT_NEAR(body["angular_momentum"], spin, 1e-9 * std::abs(spin) + 1e-10) << law;
    EXPECT_NEAR(body["total_energy"] / energy, 1, 0.01) << law;
  }
}

TEST(Rupture, TheStableStepKnowsOfLostLinks) {
  // A sheet cut all over at random: the true limit is that of one cut so from the start.
  const auto make = [](const std::vector<std::array<double, 4>>& cracks) {
    auto made = std::make_unique<test::Assembled>();
    made->body = fill(test::box_of(1, 1, 0.1), 1000, 0.95, false);
    made->body.member.assign(made->body.size(), 0);
    SolverOptions options;
    options.materials.emplace_back().constants = ElasticConstants::from(1e6, 0.3, Plane::strain);
    options.rupture = {{.stretch = 0.5}};
    options.cracks = cracks;
    made->solver = make_solver(LawName::neo_hooke, made->body, options);
    return made;
  };
  const auto whole = make({});
  const double limit = whole->solver->reference_stable_step();
  EXPECT_EQ(whole->solver->steepening(), 1);
  const std::vector<double> nothing(2 * whole->body.size(), 0.0);
  double shortest = limit;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    std::vector<std::array<double, 4>> cracks;
    const auto place = test::random_field(160, 0.5, seed);
    for (std::size_t k = 0; k < 40; ++k) {
      const double x = 0.5 + place[4 * k], y = 0.5 + place[4 * k + 1];
      cracks.push_back({x, y, x + 0.1 * place[4 * k + 2], y + 0.1 * place[4 * k + 3]});
    }
    const auto cut = make(cracks);
    const double exact = cut->solver->reference_stable_step();
    whole->solver->set_history(cut->solver->history());
    whole->solver->evaluate(nothing);
    // 0.9 of it is what runs take at most.
    EXPECT_LE(0.9 * limit / std::sqrt(whole->solver->steepening()), exact) << seed;
    shortest = std::min(shortest, exact);
  }
  EXPECT_LT(shortest, 0.9 * limit);  // without it they would not be stable
}

// Links alone, without motion.
struct Links {
  Body body;
  Neighbourhood pairs;
  std::vector<double> history;
  std::unique_ptr<Rupture> rupture;
  Links(double length, double height, const RuptureLimits& limits = {.stretch = 0.2}, double reach = 0.95)
      : body(fill(test::box_of(length, height, 0.1), 1000, reach, false)) {
    body.member.assign(body.size(), 0);
    pairs = build_neighbourhood(body, NeighbourhoodOptions());
    rupture =
        std::make_unique<Rupture>(body, pairs, std::vector<RuptureLimits>{limits}, std::vector<double>{1e6},
                                  std::vector<std::array<double, 4>>{}, Kernel::cubic_spline);
    history = rupture->rest_history();
  }
  std::vector<double> gradients(const std::vector<double>& u) const {
    std::vector<double> f = rupture->base();
    for (std::size_t i = 0; i < body.size(); ++i)
      for (std::uint32_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k)
        for (std::size_t c = 0; c < 4; ++c)
          f[4 * i + c] +=
              (u[2 * pairs.neighbour[k] + c / 2] - u[2 * i + c / 2]) * pairs.gradient[2 * k + c % 2];
    return f;
  }
};

// The upper rows are lifted, as far as `length`: only the links straight across get too long.
TEST(Rupture, ACrackCutsTheLinksThatCrossIt) {
  for (const double length : {1.0, 0.45}) {
    Links links(1.0, 0.5);
    std::vector<double> u(2 * links.body.size(), 0.0);
    for (std::size_t i = 0; i < links.body.size(); ++i)
      if (links.body.position[2 * i + 1] > 0.25 && links.body.position[2 * i] < length + 1e-9)
        u[2 * i + 1] = 0.025;
    ASSERT_TRUE(links.rupture->find_overloaded(u, {}, links.history));
    links.rupture->break_links(u, links.gradients(u), false, links.history);
    // Two diagonals between two broken ones; those ahead of the last hold.
    const double across = length < 1 ? 5 : 11;
    EXPECT_EQ(links.rupture->losses(links.history)[0], across + 2 * (across - 1)) << length;
    EXPECT_FALSE(links.rupture->find_overloaded(u, {}, links.history));
  }
}

// What a crack would set free hangs on what pulls across it and slides along it alone: not on what presses or
// pulls along it, nor on what presses it together.
TEST(Rupture, StressAlongACrackDoesNotOpenItNorDoesPressure) {
  const auto breaks = [](double along, double across, double sliding) {
    Links links(1.0, 0.5, {.energy = 1e5});
    std::vector<double> u(2 * links.body.size()), stress(4 * links.body.size());
    for (std::size_t i = 0; i < links.body.size(); ++i) {
      // Only links with a part across get longer.
      u[2 * i + 1] = 0.1 * links.body.position[2 * i + 1];
      const double volume = links.body.energy_volume[i];
      stress[4 * i] = along * volume;
      stress[4 * i + 1] = stress[4 * i + 2] = sliding * volume;
      stress[4 * i + 3] = across * volume;
    }
    return links.rupture->find_overloaded(u, {.stress = stress, .law = {}}, links.history);
  };
  double holds = 0, opens = 1e7;
  while (opens - holds > 1) {
    const double middle = 0.5 * (holds + opens);
    (breaks(0, middle, 0) ? opens : holds) = middle;
  }
  ASSERT_GT(holds, 1e5);
  ASSERT_LT(opens, 9e6);
  for (const double along : {-0.9, -0.5, 0.5, 0.9}) {
    EXPECT_FALSE(breaks(along * opens, holds, 0)) << along;
    EXPECT_TRUE(breaks(along * opens, opens, 0)) << along;
  }
  EXPECT_FALSE(breaks(-3 * opens, -3 * opens, 0));
  EXPECT_TRUE(breaks(0, 0, opens));
  EXPECT_TRUE(breaks(0, -opens, 1.001 * opens));
}

// With links of three lengths the longest hang on others that are cut with them; a mirrored body is cut the
// same.
TEST(Rupture, ACrackCutsTheSameWhateverTheNumbering) {
  std::array<double, 2> broken{};
  for (const bool upper : {false, true}) {
    Links links(1.0, 0.9, {.stretch = 0.2}, 1.3);
    std::vector<double> u(2 * links.body.size(), 0.0);
    for (std::size_t i = 0; i < links.body.size(); ++i)
      if ((links.body.position[2 * i + 1] > 0.45) == upper && links.body.position[2 * i] < 0.55)
        u[2 * i + 1] = upper ? 0.025 : -0.025;
    while (links.rupture->find_overloaded(u, {}, links.history))
      links.rupture->break_links(u, links.gradients(u), false, links.history);
    broken[upper ? 1 : 0] = links.rupture->losses(links.history)[0];
  }
  EXPECT_GT(broken[0], 16);
  EXPECT_EQ(broken[0], broken[1]);
}

TEST(Rupture, ATornOffCornerLosesAllItsLinksWhateverItsNumber) {
  double broken = 0;
  for (const bool last : {false, true}) {
    Links links(0.4, 0.4);
    std::vector<double> u(2 * links.body.size(), 0.0);
    const std::size_t corner = last ? links.body.size() - 1 : 0;
    u[2 * corner] = u[2 * corner + 1] = last ? 0.5 : -0.5;
    while (links.rupture->find_overloaded(u, {}, links.history))
      links.rupture->break_links(u, links.gradients(u), false, links.history);
    const auto lost = links.rupture->losses(links.history);
    EXPECT_EQ(lost[0], links.pairs.first[corner + 1] - links.pairs.first[corner]);
    EXPECT_EQ(lost[1], 1);
    if (last) {
      EXPECT_EQ(lost[0], broken);
    }
    broken = lost[0];
  }
}

TEST(Rupture, WhatStillCarriesInABodyThatFlowedKeepsItsDeformation) {
  Links links(0.8, 0.6);
  // Torn so unevenly that what is left of some particles' links makes no sense and is cut too.
  const std::vector<double> u = test::random_field(2 * links.body.size(), 0.08, 3);
  std::vector<std::uint8_t> gone(links.body.size(), 0);
  std::size_t unloaded = 0;
  while (links.rupture->find_overloaded(u, {}, links.history)) {
    const std::vector<double> before = links.gradients(u);
    for (const std::uint32_t i : links.rupture->break_links(u, before, true, links.history)) gone[i] = 1;
    const std::vector<double> after = links.gradients(u);
    for (std::size_t c = 0; c < after.size(); ++c)
      EXPECT_NEAR(after[c], gone[c / 4] != 0 ? (c % 4 % 3 == 0 ? 1 : 0) : before[c], 1e-9) << c;
  }
  for (const std::uint8_t one : gone) unloaded += one;
  EXPECT_GT(unloaded, 0);
  EXPECT_EQ(links.rupture->losses(links.history)[1], static_cast<double>(unloaded));
}

TEST(Rupture, TheGripsGiveWhatTheLinkOfAShellTakes) {
  // Half a strip is pushed aside until the link to the other half breaks: work of the grips, from forces and
  // ways alone, against the energy per area asked for.
  test::RunningScene strip(R"(
dimension = 2
[coupling]
mode = "transient"
window = 2e-6
end_time = 1
[solid]
kind = "shell"
polyline = [[0.0, 0.0], [0.03, 0.0]]
thickness = 0.001
spacing = 0.002
density = 2800.0
young_modulus = 7.233e10
poisson_ratio = 0.33
law = "j2_plasticity"
yield_stress = 300e6
rupture = { energy = 12e3 }
[[solid.hold]]
region = [[-0.001, -0.001], [0.015, 0.001]]
[[solid.hold]]
region = [[0.015, -0.001], [0.031, 0.001]]
displacement = ["0", "-4 * t"]
[[watch]]
name = "all"
participant = "solid"
)",
                           2e-6);
  strip.run(30);
  EXPECT_EQ(strip.value("all", "broken_links"), 1);
  EXPECT_NEAR(strip.value("all", "external_work") - strip.value("all", "kinetic_energy"), 12, 0.12);
}

// One link of a row whose ends move as told. A limit on shear sees x'.n alone, in a frame that turns with the
// fibres.
TEST(Rupture, ALinkOfAShellBreaksAtItsShearStrain) {
  const double limit = 0.003, length = 0.1;
  const ShellSection section{.thickness = 0.01,
                             .young_modulus = 2e5,
                             .shear_modulus = 8e4,
                             .density = 7.8,
                             .rupture = {.shear = limit}};
  const Body body = fill_row(std::vector<std::array<double, 2>>{{0, 0}, {length, 0}}, false, length, section);
  ASSERT_EQ(body.size(), 2U);
  ShellRow row(body, {section});
  // The second particle's place in a link stretched by `along`, sheared by `shear`, bent and turned.
  const auto breaks = [&](double along, double shear, double bend, double turn) {
    const double c = std::cos(turn), s = std::sin(turn);
    const std::vector<double> u{0, 0, length * (along * c - shear * s - 1), length * (along * s + shear * c)};
    std::vector<double> history = row.rest_history();
    history[0] = turn - 0.5 * bend;
    history[2] = turn + 0.5 * bend;
    Fields fields(2);
    row.evaluate(u, history, true, fields);
    if (row.break_links(history) == 0) {
      EXPECT_EQ(row.losses(history)[0], 0);
      return false;
    }
    Fields after(2);
    row.evaluate(u, history, false, after);
    for (const double force : after.force) EXPECT_EQ(force, 0);
    EXPECT_EQ(row.losses(history)[0], 1);
    return true;
  };
  for (const double sign : {1.0, -1.0}) {
    for (const double turn : {0.0, 0.7, 3.0}) {
      EXPECT_FALSE(breaks(1, sign * (1 - 1e-9) * limit, 0, turn)) << turn;
      EXPECT_TRUE(breaks(1, sign * (1 + 1e-9) * limit, 0, turn)) << turn;
      // However long it is, however bent.
      EXPECT_FALSE(breaks(1.5, sign * (1 - 1e-9) * limit, 0.3, turn)) << turn;
      EXPECT_TRUE(breaks(1.5, sign * (1 + 1e-9) * limit, 0.3, turn)) << turn;
    }
    EXPECT_FALSE(breaks(1 + sign * 0.9, 0, 0, 0));
    EXPECT_FALSE(breaks(1, 0, sign, 0));
  }
}

// k G h = 22.66 MN/m, and the section bears 173.2 kN/m.
TEST(Rupture, TellsTheForceOfALimitOnShear) {
  for (const auto& [limit, message] :
       {std::pair{"1e-3",
                  "2.266e+04 N/m, k G h times the shear strain 0.001, 0.131 of what the section bears"},
        std::pair{"0.2",
                  "1.732e+05 N/m, at which the section flows from a shear strain of 0.00764 to 0.2"}}) {
    Scene scene = Scene::parse(std::string(R"(
title = "limit"
dimension = 2
[coupling]
mode = "transient"
window = 1e-6
end_time = 1e-3
[solid]
solver = "solid-sph"
kind = "shell"
polyline = [[0.0, 0.0], [0.03, 0.0]]
thickness = 0.001
spacing = 0.002
density = 2800.0
young_modulus = 7.233e10
poisson_ratio = 0.33
law = "j2_plasticity"
yield_stress = 300e6
rupture = { shear = )") + limit + " }\n",
                               "scene.toml");
    Solid solid;
    std::string said;
    for (const auto& [name, value] : solid.configure(scene, "solid").derived)
      if (name.find("breaks under a shear force") != std::string::npos) said = value;
    EXPECT_EQ(said, message);
  }
}

TEST(Rupture, RefusesACrackThatBreaksNothing) {
  const auto refusal = [](const std::string& crack) -> std::string {
    try {
      Breaking body(
          "law = \"neo_hooke\"\nspacing = 0.01\nbox = { from = [0.0, 0.0], to = [0.2, 0.05] }\n"
          "rupture = { energy = 100.0, crack = [" +
              crack + "] }\n",
          1e-5);
    } catch (const BadInput& refused) {
      return refused.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("[-0.01, 0.023], [0.06, 0.023]"), "");
  EXPECT_NE(refusal("[-0.01, 0.06], [0.05, 0.06]").find("(-0.01, 0.06) to (0.05, 0.06)"), std::string::npos);
  // The second of two, along a column of particles.
  EXPECT_NE(refusal("[-0.01, 0.023], [0.06, 0.023], [0.06, 0.2]").find("to (0.06, 0.2)"), std::string::npos);
  EXPECT_EQ(refusal("[-0.01, 0.023], [0.064, 0.023], [0.064, 0.2]"), "");
}

TEST(Rupture, RepeatedWindowsARestartAndOtherThreadsGiveTheSameBits) {
  std::string text = torn("law = \"j2_plasticity\"\nyield_stress = 5e6\nrupture = { plastic_strain = 0.1 }");
  text = replaced(text, "spacing = 0.01", "spacing = 0.0028");
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  Breaking one(text, 4e-6), two(text, 4e-6), three(text, 4e-6), four(text, 4e-6);
  one.run(3);
  // Or no team is made.
  ASSERT_GT(one.result().work.updates, 5 * kSerialBelow / 4 * one.result().work.steps);
  two.run(3, true);
  EXPECT_GT(one["broken_links"], 0);
  for (const char* quantity : {"kinetic_energy", "fracture_work", "broken_links"})
    EXPECT_EQ(one[quantity], two[quantity]) << quantity;
  one.save();
  three.run(1);  // the file replaces all of it
  three.go_on_from(one);
  one.run(2);
  three.run(2);
  for (const char* quantity : {"kinetic_energy", "fracture_work", "broken_links", "isolated_mass"})
    EXPECT_EQ(one[quantity], three[quantity]) << quantity;
  omp_set_num_threads(2);
  four.run(5);
  omp_set_num_threads(threads);
  for (const char* quantity : {"kinetic_energy", "fracture_work", "broken_links", "isolated_mass"})
    EXPECT_EQ(one[quantity], four[quantity]) << quantity;
}

// Of a shell and of a solid, alone and among bodies that meet by impulses, a corner is torn off.
class IsolatedParticles : public testing::TestWithParam<const char*> {
protected:
  [[nodiscard]] static std::string scene(const std::string& fate) {
    const std::string which = GetParam();
    std::string text = R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-4
end_time = 1
[[watch]]
name = "all"
participant = "solid"
[solid]
spacing = 0.1
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
isolated_particles = ")" +
                       fate + "\"\n";
    if (which == "shell")
      return text + R"(
kind = "shell"
polyline = [[0, 0], [0.5, 0]]
thickness = 0.02
velocity = ["x > 0.45 ? 300 : 0", "0"]
rupture = { stretch = 0.1 }
)";
    if (which != "solid") text += "[[solid.body]]\nname = \"block\"\n";
    text += R"(
box = { from = [0, 0], to = [0.3, 0.3] }
velocity = ["x > 0.25 ? (y > 0.25 ? 300 : 0) : 0", "x > 0.25 ? (y > 0.25 ? 300 : 0) : 0"]
rupture = { stretch = 0.1 }
)";
    if (which == "solid") return text;
    return text + R"(
[[solid.body]]
name = "wall"
kind = "rigid"
box = { from = [0.5, -1], to = [0.8, 1] }
mass = 1
held = ["x", "y", "rotation"]
[solid.contact]
method = "pinball"
)";
  }
};

TEST_P(IsolatedParticles, AreRemovedAndAccountedFor) {
  const bool shell = std::string(GetParam()) == "shell", meets = std::string(GetParam()) == "impact";
  const double mass = shell ? 1000 * 0.02 * 0.05 : 1000 * 0.05 * 0.05;
  test::RunningScene flies(scene("fly_on"), 1e-4), removed(scene("remove"), 1e-4),
      twice(scene("remove"), 1e-4), later(scene("remove"), 1e-4);
  flies.run(14);
  removed.run(8);
  removed.save();
  later.run(1);
  later.go_on_from(removed);
  removed.run(6);
  later.run(6);
  twice.run(14, true);
  ASSERT_EQ(flies.value("all", "isolated_particles"), 1);
  EXPECT_EQ(removed.value("all", "removed_particles"), 1);
  EXPECT_NEAR(removed.value("all", "removed_mass"), mass, 1e-12);
  EXPECT_NEAR(removed.value("all", "momentum_x") + removed.value("all", "removed_momentum_x"), 300 * mass,
              1e-9);
  EXPECT_NEAR(removed.value("all", "momentum_y") + removed.value("all", "removed_momentum_y"),
              shell ? 0 : 300 * mass, 1e-9);
  EXPECT_NEAR(removed.value("all", "angular_momentum") + removed.value("all", "removed_angular_momentum"), 0,
              1e-9);
  // It left with nearly all it had.
  const double start = (shell ? 0.5 : 1.0) * mass * 300 * 300;
  EXPECT_GT(removed.value("all", "removed_energy"), 0.9 * start);
  EXPECT_LT(removed.value("all", "kinetic_energy"), 0.1 * start);
  if (meets) {
    EXPECT_GT(flies.value("all", "contact_time"), 0);
    EXPECT_EQ(removed.value("all", "contact_time"), 0);
  } else {
    EXPECT_NEAR(removed.value("all", "total_energy") / flies.value("all", "total_energy"), 1, 1e-12);
  }
  for (const char* quantity : {"kinetic_energy", "total_energy", "removed_energy", "maximum_displacement"}) {
    EXPECT_EQ(removed.value("all", quantity), later.value("all", quantity)) << quantity;
    EXPECT_EQ(removed.value("all", quantity), twice.value("all", quantity)) << quantity;
  }
}

// A crack leaves a corner on one link, or the last two particles of a side on a chain of two: nothing holds
// the end of a chain, and then nothing its next one.
TEST(Rupture, WhatHangsOnOneLinkIsRemovedToo) {
  struct Case {
    const char *law, *crack, *body;
    int particles;
  };
  const char* const corner = "[[0.345, 0.362], [0.45, 0.34]]";
  const char* const chain = "[[0.21, 0.35], [0.45, 0.35]]";
  for (const auto& [law, crack, name, particles] :
       {Case{"law = \"neo_hooke\"", corner, "", 1}, Case{"law = \"neo_hooke\"", chain, "", 2},
        Case{"law = \"j2_plasticity\"\nyield_stress = 1e5", chain, "", 2},
        Case{"law = \"neo_hooke\"", chain, "name = \"block\"\n", 2}}) {
    const bool meets = name[0] != 0;
    const auto scene = [&, material = law, line = crack, body = name](const std::string& fate) {
      return std::string(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-4
end_time = 1
[[watch]]
name = "all"
participant = "solid"
[solid]
spacing = 0.1
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
isolated_particles = ")") +
             fate + "\"\n" + material + "\n" + (meets ? "[[solid.body]]\n" : "") + body +
             "box = { from = [0, 0], to = [0.4, 0.4] }\n" +
             "velocity = [\"10 * y\", \"20 * x * x\"]\nrupture = { stretch = 10, crack = " + line + " }\n" +
             (meets ? R"(
[[solid.body]]
name = "wall"
kind = "rigid"
box = { from = [0.5, -1], to = [0.8, 1] }
mass = 1
held = ["x", "y", "rotation"]
[solid.contact]
method = "pinball"
)"
                    : "");
    };
    test::RunningScene flies(scene("fly_on"), 1e-4), removed(scene("remove"), 1e-4),
        twice(scene("remove"), 1e-4), later(scene("remove"), 1e-4);
    flies.run(1);
    removed.run(1);
    // The middle of a chain carries nothing either.
    ASSERT_EQ(flies.value("all", "isolated_particles"), particles) << crack;
    ASSERT_EQ(removed.value("all", "removed_particles"), particles) << crack;
    EXPECT_EQ(removed.value("all", "broken_links"), flies.value("all", "broken_links") + particles);
    EXPECT_NEAR(removed.value("all", "removed_mass"), 1000 * (particles * 0.005 - 0.0025), 1e-12);
    // Until here both went the same way: what was removed and cut is all that tells them apart.
    for (const char* sum : {"momentum_x", "momentum_y", "angular_momentum"})
      EXPECT_NEAR(removed.value("all", sum) + removed.value("all", std::string("removed_") + sum),
                  flies.value("all", sum), 1e-12)
          << sum;
    EXPECT_GT(removed.value("all", "fracture_work"), 0);
    EXPECT_NEAR(removed.value("all", "total_energy") / flies.value("all", "total_energy"), 1, 1e-14);
    const double x = removed.value("all", "momentum_x"), energy = removed.value("all", "total_energy"),
                 spin = removed.value("all", "angular_momentum");
    removed.save();
    later.run(1);
    later.go_on_from(removed);
    removed.run(9);
    later.run(9);
    twice.run(10, true);
    EXPECT_EQ(removed.value("all", "removed_particles"), particles);
    EXPECT_NEAR(removed.value("all", "momentum_x"), x, 1e-12);
    EXPECT_NEAR(removed.value("all", "angular_momentum"), spin, 1e-12);
    EXPECT_NEAR(removed.value("all", "total_energy") / energy, 1, 1e-3);
    for (const char* quantity : {"kinetic_energy", "total_energy", "removed_energy", "fracture_work"}) {
      EXPECT_EQ(removed.value("all", quantity), later.value("all", quantity)) << quantity;
      EXPECT_EQ(removed.value("all", quantity), twice.value("all", quantity)) << quantity;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Of, IsolatedParticles, testing::Values("shell", "solid", "impact"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace estuary::solid
