// What is kept of the coupler between two windows, and that it goes on from there bit for bit.
#include "coupler_state.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "acceleration.hpp"
#include "checkpoint.hpp"
#include "convergence.hpp"
#include "run_record.hpp"
#include "temporary_folder.hpp"
#include "window_clock.hpp"

namespace estuary::coupler {
namespace {

using testing::ElementsAreArray;

// A window of six iterations of a coupled linear problem with some curvature; returns the last iterate.
std::vector<double> window(Acceleration& acceleration, double load) {
  std::vector<double> x(8, 0.0);
  std::vector<double> residual(8);
  acceleration.begin_window();
  for (int k = 0; k < 6; ++k) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double neighbour = x[(i + 3) % x.size()];
      residual[i] = load * std::sin(static_cast<double>(i + 1)) - 1.5 * x[i] + 0.4 * neighbour +
                    0.05 * x[i] * neighbour;
    }
    acceleration.update(residual, x);
  }
  return x;
}

class Kept : public testing::TestWithParam<std::pair<AccelerationKind, std::vector<std::size_t>>> {};

TEST_P(Kept, AccelerationGoesOnBitForBit) {
  const AccelerationSettings settings{
      .kind = GetParam().first, .relaxation = 0.3, .windows_reused = 2, .fields = GetParam().second};
  const auto original = make_acceleration(settings);
  for (const double load : {1.0, 1.3, 1.1, 0.7}) window(*original, load);
  StateWriter state;
  original->save(state);
  const auto copy = make_acceleration(settings);
  window(*copy, 5.0);  // what it had learnt before has to go
  StateReader reader(state.values());
  copy->load(reader);
  EXPECT_NO_THROW(reader.require_end());
  for (const double load : {0.9, 1.2, 1.4})
    EXPECT_THAT(window(*copy, load), ElementsAreArray(window(*original, load)));
}

TEST_P(Kept, DamagedStatesAreRefused) {
  const AccelerationSettings settings{
      .kind = GetParam().first, .relaxation = 0.3, .windows_reused = 2, .fields = GetParam().second};
  const auto original = make_acceleration(settings);
  for (const double load : {1.0, 1.3}) window(*original, load);
  StateWriter state;
  original->save(state);
  for (std::size_t size = 0; size < state.values().size(); ++size) {
    const auto copy = make_acceleration(settings);
    StateReader reader(std::span(state.values()).first(size));
    EXPECT_THROW(copy->load(reader), std::runtime_error) << size;
  }
}

// Any number of a state may be another: what is a length asks for no more than there is, what is none is
// taken.
TEST_P(Kept, LengthsThatAreNotThereAreRefused) {
  const AccelerationSettings settings{
      .kind = GetParam().first, .relaxation = 0.3, .windows_reused = 2, .fields = GetParam().second};
  const auto original = make_acceleration(settings);
  for (const double load : {1.0, 1.3, 1.1}) window(*original, load);
  StateWriter state;
  original->save(state);
  for (const double wrong : {9007199254740992.0, 1e6, -1.0, 3.0}) {
    for (std::size_t place = 0; place < state.values().size(); ++place) {
      auto values = state.values();
      values[place] = wrong;
      const auto copy = make_acceleration(settings);
      StateReader reader(values);
      try {
        copy->load(reader);
        reader.require_end();
        window(*copy, 1.2);
      } catch (const std::runtime_error&) {  // nothing else, and no memory that is not there
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Accelerations, Kept,
                         testing::Values(std::pair(AccelerationKind::none, std::vector<std::size_t>{}),
                                         std::pair(AccelerationKind::aitken, std::vector<std::size_t>{}),
                                         std::pair(AccelerationKind::iqn_ils, std::vector<std::size_t>{}),
                                         std::pair(AccelerationKind::iqn_ils, std::vector<std::size_t>{3, 5}),
                                         std::pair(AccelerationKind::iqn_imvj, std::vector<std::size_t>{}),
                                         std::pair(AccelerationKind::iqn_imvj,
                                                   std::vector<std::size_t>{3, 5})));

TEST(WindowClock, GoesOnFromWhereItWas) {
  WindowClock clock(0.1, 10);
  clock.allow_shorter(0.01, 0.0);
  clock.accept();
  clock.shorten();
  clock.accept();
  StateWriter state;
  clock.save(state);
  WindowClock longer(0.1, 12);
  longer.allow_shorter(0.01, 0.0);
  StateReader reader(state.values());
  longer.load(reader);
  while (!clock.at_end()) {
    EXPECT_EQ(longer.span().begin, clock.span().begin);
    EXPECT_EQ(longer.span().duration, clock.span().duration);
    longer.accept();
    clock.accept();
  }
  EXPECT_FALSE(longer.at_end());
}

TEST(CouplerState, FileHoldsEverything) {
  const TemporaryFolder folder;
  const CouplerState state{
      .window = 7,
      .time = 0.7,
      .total_iterations = 31,
      .frame = 3,
      .care = 2,
      .history = {{{{0.1, -0.2}, {1e-300, 3.0}, {0, 4294967295U}}, {5.0, 1.0 / 3.0}}, {0.25, 1e10}, 0.05},
      .clock = {1, 7, 1, 0},
      .convergence = {2.0, 3.0, 0.0, 0.0},
      .acceleration = {},
      .messages = {{"fluid", std::string("\0\xff\x01", 3)}, {"solid", ""}},
      .record = {{"iterations.csv", 120}, {"watch/tip.csv", 44}},
      .messages_record = {{"fluid", 99}},
      .wall_s = 12.5};
  write_coupler_state(folder.path() / "state.h5", state);
  const CouplerState read = read_coupler_state(folder.path() / "state.h5");
  EXPECT_EQ(read.window, state.window);
  EXPECT_EQ(read.total_iterations, state.total_iterations);
  EXPECT_EQ(read.frame, state.frame);
  EXPECT_EQ(read.care, state.care);
  EXPECT_EQ(read.history.accepted.motion.displacement, state.history.accepted.motion.displacement);
  EXPECT_EQ(read.history.accepted.motion.velocity, state.history.accepted.motion.velocity);
  EXPECT_EQ(read.history.accepted.motion.torn, state.history.accepted.motion.torn);
  EXPECT_EQ(read.history.accepted.forces, state.history.accepted.forces);
  EXPECT_EQ(read.history.earlier_velocity, state.history.earlier_velocity);
  EXPECT_EQ(read.history.earlier_duration, state.history.earlier_duration);
  EXPECT_EQ(read.clock, state.clock);
  EXPECT_EQ(read.convergence, state.convergence);
  EXPECT_EQ(read.acceleration, state.acceleration);
  EXPECT_EQ(read.messages, state.messages);
  EXPECT_EQ(read.record, state.record);
  EXPECT_EQ(read.messages_record, state.messages_record);
  EXPECT_EQ(read.wall_s, state.wall_s);
}

TEST(CouplerState, CountsAreWhole) {
  const TemporaryFolder folder;
  for (const std::string window : {"-1", "1e300", "1.5", "\"7\"", "[[[]]]"}) {
    CheckpointWriter writer(folder.path() / "state.h5");
    writer.add_bytes(
        "description",
        R"({"total_iterations":1,"frame":1,"care":0,"record":{},"messages_record":{},"messages":[],"window":)" +
            window + "}");
    writer.add("times", std::vector<double>{1, 1, 1});
    writer.commit();
    try {
      (void)read_coupler_state(folder.path() / "state.h5");
      FAIL() << window;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("is no count"));
    }
  }
}

TEST(CouplerState, FilesOutsideTheRunsFolderAreRefused) {
  const TemporaryFolder folder;
  CouplerState state;
  for (const char* name : {"../other.csv", "/etc/passwd", "watch/../../x.csv"}) {
    state.record = {{name, 1}};
    write_coupler_state(folder.path() / "state.h5", state);
    EXPECT_THROW((void)read_coupler_state(folder.path() / "state.h5"), std::runtime_error) << name;
  }
}

// Tables of a run of two participants.
class RunTables : public testing::Test {
protected:
  RunTables() { scene_.participants.resize(2); }
  [[nodiscard]] std::string content(const char* name) const {
    std::ifstream file(folder_.path() / name);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }
  TemporaryFolder folder_;
  CouplingScene scene_;
};

TEST_F(RunTables, GoesBackToAPlace) {
  v1::WatchSample tip;
  tip.set_name("tip");
  tip.add_quantity("x");
  tip.add_value(1.0 / 3.0);
  RecordPosition position;
  {
    RunRecord record(folder_.path(), scene_);
    for (std::uint64_t window = 1; window <= 4; ++window) {
      if (window == 3) position = record.position();
      IterationRow row;
      row.window = window;
      row.iteration = 1;
      record.add(row);
      record.add(WindowRow{.window = window,
                           .total_iterations = window,
                           .iterations = 1,
                           .verdict = "not converged",
                           .time = 0.1 * static_cast<double>(window),
                           .residual = 1e-5,
                           .wall_s = 0.25,
                           .duration = 0.1});
      record.add(tip, window, 1, 0.1 * static_cast<double>(window));
      if (window == 3) {
        v1::WatchSample late = tip;
        late.set_name("late");
        record.add(late, window, 1, 0.3);
      }
    }
  }
  RunRecord record(folder_.path(), scene_, position);
  const RecordedRun recorded = record.read();
  ASSERT_EQ(recorded.windows.size(), 2U);
  EXPECT_EQ(recorded.windows[1].verdict, "not converged");
  EXPECT_EQ(recorded.windows[1].total_iterations, 2U);
  EXPECT_EQ(recorded.windows[1].duration, 0.1);
  ASSERT_EQ(recorded.watches.size(), 1U);
  EXPECT_THAT(recorded.watches.at("tip").at("x").value, ElementsAreArray({1.0 / 3.0, 1.0 / 3.0}));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "watch" / "late.csv"));
  record.add(tip, 3, 1, 0.3);
  record.flush();
  const std::string text = content("watch/tip.csv");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
  RecordPosition too_far = position;
  too_far["iterations.csv"] = 1000000;
  EXPECT_THROW(record.go_back(too_far), std::runtime_error);
  std::ofstream(folder_.path() / "watch" / "tip.csv") << std::string(position.at("watch/tip.csv"), '#');
  EXPECT_THROW(record.go_back(position), std::runtime_error);
}

// Rows that are not on disk yet belong to what is thrown away.
TEST_F(RunTables, BeginsAnewWithoutWhatWasHeldBack) {
  std::string untouched[2];
  {
    RunRecord record(folder_.path(), scene_);
    record.flush();
    untouched[0] = content("iterations.csv");
    untouched[1] = content("convergence.csv");
    IterationRow row;
    row.window = row.iteration = 1;
    record.add(row);
    record.add(WindowRow{.window = 1, .total_iterations = 1, .iterations = 1, .verdict = "converged"});
    record.begin_anew();
  }
  EXPECT_EQ(content("iterations.csv"), untouched[0]);
  EXPECT_EQ(content("convergence.csv"), untouched[1]);
}

}  // namespace
}  // namespace estuary::coupler
