#include "replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "temporary_folder.hpp"

namespace estuary {
namespace {

using testing::HasSubstr;

class ReplayTest : public testing::Test {
protected:
  // Two windows of a fluid on three nodes, the second of two iterations.
  void write(bool with_windows = true) const {
    RecordWriter writer(path_);
    v1::Request request;
    v1::Reply reply;
    request.mutable_hello();
    reply.mutable_welcome()->set_name("water");
    writer.add(request, reply);
    request.mutable_configure()->set_role("fluid");
    reply.mutable_configured();
    writer.add(request, reply);
    auto& surface = *request.mutable_start()->mutable_initial()->mutable_wet_surface();
    surface.set_dimension(2);
    surface.mutable_reference_positions()->Resize(6, 0.0);
    reply.mutable_started();
    writer.add(request, reply);
    if (!with_windows) return;
    for (const auto& [window, iteration] : {std::pair{1, 1}, {2, 1}, {2, 2}}) {
      request.mutable_header()->set_window(static_cast<std::uint64_t>(window));
      request.mutable_header()->set_iteration(static_cast<std::uint64_t>(iteration));
      auto& advance = *request.mutable_advance();
      advance.set_time(0.1 * (window - 1));
      advance.set_duration(0.1);
      advance.mutable_inputs()->mutable_displacements()->mutable_displacement()->Resize(6, 1.0);
      reply.mutable_advanced()->mutable_outputs()->mutable_pressures()->add_pressure(10 * window + iteration);
      writer.add(request, reply);
      reply.Clear();
    }
  }
  static v1::Exchange inputs(int values, double value) {
    v1::Exchange exchange;
    exchange.mutable_displacements()->mutable_displacement()->Resize(values, value);
    return exchange;
  }
  static double answer(Replay& replay, std::uint64_t window, std::uint64_t iteration, double value = 1.0) {
    ProgressBoard board;
    return replay
        .advance({.number = window,
                  .iteration = iteration,
                  .time = 0.1 * static_cast<double>(window - 1),
                  .duration = 0.1},
                 inputs(6, value), board)
        .outputs.pressures()
        .pressure(0);
  }
  template <typename Call>
  static std::string complaint(const Call& call) {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "fluid.record";
};

TEST_F(ReplayTest, AnswersEachIterationAsRecorded) {
  write();
  Replay replay(path_, Beyond::refuse);
  EXPECT_EQ(replay.identity().name, "replay of water");
  EXPECT_EQ(answer(replay, 1, 1), 11);
  EXPECT_EQ(answer(replay, 2, 1), 21);
  EXPECT_EQ(answer(replay, 2, 2), 22);
  EXPECT_EQ(answer(replay, 1, 1), 11);
  EXPECT_EQ(replay.largest_difference(), 0);
  (void)answer(replay, 2, 1, 1.5);
  EXPECT_DOUBLE_EQ(replay.largest_difference(), 0.5);
}

TEST_F(ReplayTest, SaysWhatWasNotRecorded) {
  write();
  Replay replay(path_, Beyond::refuse);
  EXPECT_THAT(complaint([&] { answer(replay, 1, 2); }), HasSubstr("iteration 2 of window 1"));
  EXPECT_THAT(complaint([&] { answer(replay, 3, 1); }), HasSubstr("window 3"));
  ProgressBoard board;
  EXPECT_THAT(complaint([&] {
                (void)replay.advance({.number = 2, .iteration = 1, .time = 0.1, .duration = 0.05},
                                     inputs(6, 1), board);
              }),
              HasSubstr("0.05 s"));
  EXPECT_THAT(complaint([&] {
                (void)replay.advance({.number = 2, .iteration = 1, .time = 0.1, .duration = 0.1},
                                     inputs(8, 1), board);
              }),
              HasSubstr("8 values"));
  v1::Exchange other;
  other.mutable_wet_surface()->set_dimension(2);
  other.mutable_wet_surface()->mutable_reference_positions()->Resize(8, 0.0);
  EXPECT_THAT(complaint([&] { replay.start(other, "."); }), HasSubstr("4 nodes"));
}

TEST_F(ReplayTest, CanAnswerEveryIterationWithWhatWasAccepted) {
  write();
  Replay replay(path_, Beyond::accepted);
  EXPECT_EQ(answer(replay, 2, 1), 22);
  EXPECT_EQ(answer(replay, 2, 9), 22);
}

TEST_F(ReplayTest, ARecordCutShortIsUsedAsFarAsItGoes) {
  write();
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 3);
  Replay replay(path_, Beyond::refuse);
  EXPECT_EQ(answer(replay, 2, 1), 21);
  EXPECT_THAT(complaint([&] { answer(replay, 2, 2); }), HasSubstr("not recorded"));
}

TEST_F(ReplayTest, RefusesWhatIsNoRecord) {
  std::ofstream(path_) << "iterations,residual\n1,0.5\n2,0.25\n\xff\xff\xff\xff\xff\xff\xff";
  EXPECT_NE(complaint([&] { Replay(path_, Beyond::refuse); }), "");
  write(false);
  EXPECT_THAT(complaint([&] { Replay(path_, Beyond::refuse); }), HasSubstr("nothing to replay"));
  EXPECT_THAT(complaint([&] { Replay(path_ / "none", Beyond::refuse); }), HasSubstr("cannot read"));
}

}  // namespace
}  // namespace estuary
