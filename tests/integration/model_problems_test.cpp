// Model problems with exact answers, run as a person runs them: the order of the interpolation in time
// between participants, and what becomes of every scheme where added mass makes the iteration diverge.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "coupler_run.hpp"

namespace {

using estuary::coupler::Finished;

class ModelProblem : public estuary::test::CouplerRun {
protected:
  Finished run(const std::string& scene, const std::vector<std::string>& settings) const {
    return run_scene(std::string(SCENES) + "/fsi/" + scene, settings);
  }
  nlohmann::json watch(const std::string& name) const { return summary()["watch"][name]; }
};

// Two masses and three springs with ten steps in each window: what is left is the error of the interpolation.
TEST_F(ModelProblem, TheInterpolationInTimeHasTheOrderOfItsKind) {
  const auto error = [&](const std::string& kind, double window) {
    const Finished finished =
        run("two-masses-three-springs.toml", {"coupling.window=" + std::to_string(window),
                                              "fluid.interpolation=" + kind, "solid.interpolation=" + kind});
    EXPECT_LE(finished.status, 1) << finished.errors;
    return std::hypot(watch("left")["error"]["last"].get<double>(),
                      watch("right")["error"]["last"].get<double>());
  };
  const auto order = [&](const std::string& kind) {
    return std::log2(error(kind, 0.014) / error(kind, 0.007));
  };
  EXPECT_NEAR(order("constant"), 1.0, 0.25);
  EXPECT_NEAR(order("linear"), 2.0, 0.2);
  EXPECT_NEAR(order("quadratic"), 3.0, 0.3);
}

// A string above a fluid with 17 to 70 times its mass. A run either gives the exact answer of the coupling or
// says that it has none.
TEST_F(ModelProblem, NoSchemeLiesUnderStrongAddedMass) {
  const auto outcome = [&](const std::string& scheme, const std::string& acceleration, double density,
                           double window) {
    const Finished finished =
        run("added-mass-string.toml",
            {"coupling.scheme=" + scheme, "coupling.acceleration=" + acceleration,
             "solid.density=" + std::to_string(density), "coupling.window=" + std::to_string(window),
             "coupling.end_time=" + std::to_string(10 * window), "coupling.relaxation=0.5"});
    if (finished.status == 3) return std::string("said no");
    EXPECT_LE(finished.status, 1) << finished.errors;
    return watch("string")["coupling_error"]["max"].get<double>() < 1e-3 ? std::string("right")
                                                                         : std::string("lie");
  };
  for (const auto& [window, density] : {std::pair{0.001, 0.2}, {0.1, 0.05}}) {
    for (const std::string acceleration : {"iqn-ils", "iqn-imvj"})
      EXPECT_EQ(outcome("serial-implicit", acceleration, density, window), "right")
          << acceleration << density;
    EXPECT_EQ(outcome("parallel-implicit", "iqn-ils", density, window), "right") << density;
    for (const std::string acceleration : {"aitken", "constant"})
      EXPECT_NE(outcome("serial-implicit", acceleration, density, window), "lie") << acceleration << density;
    EXPECT_EQ(outcome("serial-implicit", "none", density, window), "said no") << density;
    EXPECT_EQ(outcome("serial-explicit", "none", density, window), "said no") << density;
  }
}

}  // namespace
