// Runs of the elastic tube (elastic_tube.cpp) through the parts of the coupler that change what is exchanged:
// mapping between surfaces, record and replay, shorter windows, integrals of the wet surface.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "coupler_run.hpp"
#include "csv_file.hpp"
#include "file_text.hpp"

namespace {

using estuary::coupler::Finished;
using estuary::coupler::read_csv;
using estuary::test::file_text;
using testing::HasSubstr;

class TubeRun : public estuary::test::CouplerRun {
protected:
  // Ten windows of a tube.
  Finished run(const std::string& out, const std::string& coupling, const std::string& fluid,
               const std::string& solid, const std::string& rest = {},
               const std::vector<std::string>& overrides = {}) {
    const auto scene = folder_ / (out + ".toml");
    const std::string solver = "solver = \"" + estuary::test::participant_program(ELASTIC_TUBE) + "\"\n";
    std::ofstream(scene)
        << "title = \"tube\"\n[coupling]\nmode = \"transient\"\nwindow = 0.01\nend_time = 0.1\n"
        << "acceleration = \"iqn-ils\"\nrelaxation = 0.01\nmax_iterations = 100\n"
        << "tolerance = 1e-7\nforce_tolerance = 1e-7\nvelocity_tolerance = 1.0\n"
        << coupling << "\n[fluid]\n"
        << solver << fluid << "\n[solid]\n"
        << solver << solid << '\n'
        << rest << "\n[[watch]]\nname = \"flow\"\nparticipant = \"fluid\"\n";
    return run_scene(scene, overrides, out);
  }
  double last(const std::string& out, const std::string& watch, const std::string& quantity) const {
    return summary(out)["watch"][watch][quantity]["last"];
  }
  // Highest pressure at the inflow of all windows.
  double largest(const std::string& out) const { return summary(out)["watch"]["flow"]["pressure"]["max"]; }
  // Largest difference of two columns of convergence.csv, relative to the largest value.
  double difference(const std::string& out, const std::string& one, const std::string& other) const {
    const auto table = read_csv(folder_ / out / "convergence.csv");
    const auto& a = *table->column(one);
    const auto& b = *table->column(other);
    double largest = 0;
    double size = 1e-300;
    for (std::size_t k = 0; k < a.size(); ++k) {
      largest = std::max(largest, std::abs(a[k] - b[k]));
      size = std::max(size, std::abs(a[k]));
    }
    return largest / size;
  }
};

// 100 against 73 nodes. Where pressures are mapped, the flow is that of matching nodes. Where forces are,
// force, moment and power come through to round-off; a wall that answers at each node alone then shows how
// unevenly the nodes of two meshes share the load, an error that finer meshes of the same ratio do not lessen
// (de Boer, van Zuijlen & Bijl 2008).
TEST_F(TubeRun, SurfacesOfOtherNodesAreMappedAndConserve) {
  ASSERT_EQ(run("matching", "", "intervals = 99", "intervals = 99").status, 0);
  const double matching = largest("matching");
  for (const std::string kind : {"nearest-projection", "thin-plate-spline", "nearest-neighbour"}) {
    for (const std::string loads : {"forces", "pressures"}) {
      const std::string out = kind + "-" + loads;
      const Finished finished =
          run(out, "", "intervals = 99\nown_surface = true", "intervals = 72",
              "[coupling.mapping]\nkind = \"" + kind + "\"\nloads = \"" + loads + "\"\n");
      ASSERT_EQ(finished.status, 0) << out << finished.errors;
      EXPECT_THAT(file_text(folder_ / out / "log" / "coupler.log"), HasSubstr("100 nodes on the solid's 73"));
      const bool linear = kind != "nearest-neighbour";
      if (loads == "pressures") {
        EXPECT_NEAR(largest(out), matching, 1e-3 * matching) << out;
        continue;
      }
      if (linear) {
        EXPECT_NEAR(largest(out), matching, 0.1 * matching) << out;
        EXPECT_LT(difference(out, "unmapped_moment", "moment"), 1e-10) << out;
      }
      EXPECT_LT(difference(out, "unmapped_force_y", "force_y"), 1e-11) << out;
      EXPECT_LT(difference(out, "unmapped_power", "fluid_power"), 1e-11) << out;
    }
  }
}

TEST_F(TubeRun, AMappingThatCannotBeMadeIsNamed) {
  const Finished finished = run("far", "", "intervals = 99\nown_surface = true", "intervals = 72",
                                "[coupling.mapping]\nkind = \"wendland-c2\"\nsupport_radius = 1e-4\n");
  EXPECT_EQ(finished.status, 2);
  EXPECT_THAT(finished.errors, HasSubstr("'fluid'"));
  EXPECT_THAT(finished.errors, HasSubstr("support_radius"));
}

// The same bits against the recorded partner, whichever of the two it is.
TEST_F(TubeRun, ASolverAgainstItsRecordedPartnerGivesTheSameBits) {
  ASSERT_EQ(run("recorded", "", "", "", "[output]\nrecord = true\n").status, 0);
  const std::string watch = file_text(folder_ / "recorded" / "watch" / "flow.csv");
  const auto replay = [&](const std::string& role) {
    return role + ".solver=\"" + REPLAY + " " + (folder_ / "recorded/record" / (role + ".record")).string() +
           "\"";
  };
  for (const std::string role : {"fluid", "solid"}) {
    const Finished finished = run("replayed-" + role, "", "", "", "", {replay(role)});
    ASSERT_EQ(finished.status, 0) << finished.errors;
    const auto out = folder_ / ("replayed-" + role);
    EXPECT_EQ(file_text(out / "watch" / "flow.csv"), watch);
    EXPECT_THAT(file_text(out / "log" / (role + ".log")), HasSubstr("bit for bit"));
  }
  // What does not fit is named.
  Finished finished = run("other-nodes", "", "", "intervals = 80", "", {replay("fluid")});
  EXPECT_EQ(finished.status, 4);
  EXPECT_THAT(finished.errors, HasSubstr("has 81 nodes; that of the recorded run had 101"));
  finished = run("other-times", "", "", "", "", {replay("fluid"), "coupling.window=0.02"});
  EXPECT_EQ(finished.status, 4);
  EXPECT_THAT(finished.errors, HasSubstr("lasts 0.02 s; in the recorded run"));
  finished = run("longer", "", "", "", "", {replay("fluid"), "coupling.end_time=0.2"});
  EXPECT_EQ(finished.status, 4);
  EXPECT_THAT(finished.errors, HasSubstr("window 11 was not recorded"));
}

// The fluid has no solution for windows of 0.01 s: half of them do. Every window is written with its length,
// and the end is met exactly.
TEST_F(TubeRun, AWindowThatFailsIsTriedWithHalfTheLength) {
  const Finished fixed = run("fixed", "", "longest_window = 0.006", "");
  EXPECT_EQ(fixed.status, 3);
  const Finished finished = run("adaptive", "adaptive_window = true", "longest_window = 0.006", "");
  ASSERT_EQ(finished.status, 0) << finished.errors;
  EXPECT_THAT(file_text(folder_ / "adaptive" / "log" / "coupler.log"), HasSubstr("with a window of 0.005 s"));
  const auto table = read_csv(folder_ / "adaptive" / "iterations.csv");
  const auto& lengths = *table->column("window_length");
  EXPECT_EQ(lengths.size(), 20U);
  for (const double length : lengths) EXPECT_DOUBLE_EQ(length, 0.005);
  EXPECT_DOUBLE_EQ(table->column("time")->back(), 0.1);
  const auto watch = read_csv(folder_ / "adaptive" / "watch" / "flow.csv");
  EXPECT_DOUBLE_EQ(watch->column("time")->back(), 0.1);
  const Finished refused =
      run("too-short", "adaptive_window = true\nsmallest_window = 0.008", "longest_window = 0.006", "");
  EXPECT_EQ(refused.status, 3);
}

TEST_F(TubeRun, IntegralsOfTheWetSurfaceAreWatched) {
  ASSERT_EQ(run("watched", "", "", "",
                "[[watch]]\nname = \"surface\"\nparticipant = \"coupling\"\n"
                "[[check]]\nquantity = \"surface.iterations.max\"\nat_most = 30\n")
                .status,
            0);
  const auto sums = read_csv(folder_ / "watched" / "convergence.csv");
  EXPECT_DOUBLE_EQ(last("watched", "surface", "force_y"), sums->column("force_y")->back());
  EXPECT_DOUBLE_EQ(last("watched", "surface", "moment"), sums->column("moment")->back());
  EXPECT_NE(last("watched", "surface", "mean_displacement_y"), 0.0);
  EXPECT_EQ(last("watched", "surface", "mean_displacement_x"), 0.0);
}

}  // namespace
