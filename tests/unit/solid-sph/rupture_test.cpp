// Solid bodies that break: when, what is kept, and how a run goes on from there.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "bodies.hpp"
#include "rupture.hpp"
#include "solid.hpp"

namespace estuary::solid {
namespace {

class Breaking {
public:
  explicit Breaking(const std::string& text, double window) : window_(window) {
    Scene scene = Scene::parse(
        "dimension = 2\n[coupling]\nmode = \"transient\"\nwindow = 1e-5\nend_time = 1\n[[watch]]\nname = "
        "\"all\"\nparticipant = \"solid\"\n[solid]\ndensity = 1000\nyoung_modulus = 1e9\npoisson_ratio = "
        "0.3\n" +
            text,
        "scene.toml");
    solid_.configure(scene, "solid");
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    static int number = 0;
    folder_ = std::filesystem::temp_directory_path() /
              ("solid-sph-rupture-" + std::to_string(::getpid()) + "-" + std::to_string(++number));
    solid_.start({}, folder_);
  }
  ~Breaking() { std::filesystem::remove_all(folder_); }
  void run(int windows, bool repeat = false) {
    for (int w = 0; w < windows; ++w) {
      ++count_;
      for (std::uint64_t iteration = 1; iteration <= (repeat ? 2U : 1U); ++iteration)
        result_ = solid_.advance({.number = count_,
                                  .iteration = iteration,
                                  .mode = Mode::transient,
                                  .time = window_ * static_cast<double>(count_ - 1),
                                  .duration = window_},
                                 {}, board_);
      solid_.accept();
    }
  }
  double operator[](const std::string& quantity) {
    for (const auto& [name, number] : result_.watches[0].quantities)
      if (name == quantity) return number;
    ADD_FAILURE() << "no " << quantity;
    return 0;
  }
  Solid& solid() { return solid_; }
  std::filesystem::path file() const { return folder_ / "saved"; }

private:
  Solid solid_;
  AdvanceResult result_;
  ProgressBoard board_;
  double window_;
  std::uint64_t count_ = 0;
  std::filesystem::path folder_;
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
    strip.run(18);  // 1.13
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

// Links alone, without motion.
struct Links {
  Body body;
  Neighbourhood pairs;
  std::vector<double> history;
  std::unique_ptr<Rupture> rupture;
  Links(double length, double height) : body(fill(test::box_of(length, height, 0.1), 1000, 0.95, false)) {
    body.member.assign(body.size(), 0);
    pairs = build_neighbourhood(body, NeighbourhoodOptions());
    rupture = std::make_unique<Rupture>(body, pairs, std::vector<RuptureLimits>{{.stretch = 0.2}},
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

TEST(Rupture, RepeatedWindowsAndARestartGiveTheSameBits) {
  const std::string text =
      torn("law = \"j2_plasticity\"\nyield_stress = 5e6\nrupture = { plastic_strain = 0.1 }");
  Breaking one(text, 2e-5), two(text, 2e-5), three(text, 2e-5);
  one.run(15);
  two.run(15, true);
  EXPECT_GT(one["broken_links"], 0);
  for (const char* quantity : {"kinetic_energy", "fracture_work", "broken_links"})
    EXPECT_EQ(one[quantity], two[quantity]) << quantity;
  one.solid().save(one.file());
  one.run(5);
  three.run(1);
  three.solid().load(one.file());
  three.run(5);
  for (const char* quantity : {"kinetic_energy", "fracture_work", "broken_links", "isolated_mass"})
    EXPECT_EQ(one[quantity], three[quantity]) << quantity;
}

}  // namespace
}  // namespace estuary::solid
