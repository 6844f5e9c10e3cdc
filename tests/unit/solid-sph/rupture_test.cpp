// Solid bodies that break: when, what is kept, and how a run goes on from there.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>

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
