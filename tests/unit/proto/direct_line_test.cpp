#include "direct_line.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <thread>

#include "channel.hpp"

namespace estuary {
namespace {

std::string local_path(const char* name) {
  return (std::filesystem::temp_directory_path() /
          (std::string("estuary-line-") + name + "-" + std::to_string(::getpid())))
      .string();
}

void wait_for(int descriptor) {
  pollfd wait{descriptor, POLLIN, 0};
  ASSERT_EQ(::poll(&wait, 1, 5000), 1);
}

v1::Request advance(int nodes) {
  v1::Request request;
  request.mutable_header()->set_sequence(3);
  auto& displacement = *request.mutable_advance()->mutable_inputs()->mutable_displacements();
  for (int i = 0; i < nodes; ++i) displacement.add_displacement(0.1 * i);
  return request;
}

// Both ends of a line.
struct Pair {
  std::array<int, 2> descriptor{};
  DirectLine near;
  DirectLine far;
  static std::array<int, 2> sockets() {
    std::array<int, 2> both{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, both.data()), 0);
    return both;
  }
  Pair() : descriptor(sockets()), near(descriptor[0]), far(descriptor[1]) {}
};

TEST(DirectLine, CarriesAMessageLargerThanTheSocketHolds) {
  Pair line;
  const v1::Request sent = advance(300'000);
  std::thread writer([&] { EXPECT_EQ(line.near.send(sent), sent.ByteSizeLong() + 8); });
  v1::Request received;
  auto state = DirectLine::Received::nothing;
  while (state == DirectLine::Received::nothing) {
    wait_for(line.far.descriptor());
    state = line.far.receive(received);
  }
  writer.join();
  ASSERT_EQ(state, DirectLine::Received::message);
  EXPECT_EQ(received.SerializeAsString(), sent.SerializeAsString());
  EXPECT_EQ(line.far.bytes_received(), sent.ByteSizeLong() + 8);
  EXPECT_EQ(line.far.receive(received), DirectLine::Received::nothing);
}

TEST(DirectLine, TwoMessagesThatArriveTogetherAreTwo) {
  Pair line;
  ASSERT_NE(line.near.send(advance(3)), 0U);
  ASSERT_NE(line.near.send(advance(5)), 0U);
  v1::Request received;
  ASSERT_EQ(line.far.receive(received), DirectLine::Received::message);
  EXPECT_EQ(received.advance().inputs().displacements().displacement_size(), 3);
  ASSERT_EQ(line.far.receive(received), DirectLine::Received::message);
  EXPECT_EQ(received.advance().inputs().displacements().displacement_size(), 5);
}

TEST(DirectLine, NoticesThatTheOtherEndIsGone) {
  Pair line;
  { const DirectLine gone = std::move(line.far); }
  v1::Request received;
  EXPECT_EQ(line.near.receive(received), DirectLine::Received::closed);
  EXPECT_EQ(line.near.send(advance(3)), 0U);
}

TEST(DirectLine, RefusesWhatIsNoMessage) {
  v1::Request received;
  {
    Pair line;
    const std::array<char, 12> garbage{4, 0, 0, 0, 0, 0, 0, 0, '\xff', '\xff', '\xff', '\xff'};
    ASSERT_EQ(::send(line.near.descriptor(), garbage.data(), garbage.size(), 0), 12);
    EXPECT_THROW((void)line.far.receive(received), ChannelError);
  }
  Pair line;
  const std::uint64_t huge = std::uint64_t{1} << 60U;
  ASSERT_EQ(::send(line.near.descriptor(), &huge, sizeof huge, 0), 8);
  EXPECT_THROW((void)line.far.receive(received), ChannelError);
}

TEST(DirectLine, IsEnteredByThisUserOnlyAndOnlyWhereSomebodyListens) {
  const std::string path = local_path("entrance");
  EXPECT_FALSE(DirectLine::connect(path));
  DirectLineEntrance entrance(path);
  EXPECT_FALSE(entrance.accept());
  struct stat entry {};
  ASSERT_EQ(::stat(path.c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777U, 0600U);
  auto near = DirectLine::connect(path);
  ASSERT_TRUE(near);
  wait_for(entrance.descriptor());
  auto far = entrance.accept();
  ASSERT_TRUE(far);
  ASSERT_NE(near->send(advance(2)), 0U);
  wait_for(far->descriptor());
  v1::Request received;
  EXPECT_EQ(far->receive(received), DirectLine::Received::message);
}

TEST(DirectLine, LiesBesideLocalAddressesOnly) {
  EXPECT_EQ(direct_line_path("ipc:///tmp/run/fluid"), "/tmp/run/fluid.line");
  EXPECT_EQ(direct_line_path("tcp://127.0.0.1:5555"), "");
  EXPECT_EQ(direct_line_path("ipc:///" + std::string(104, 'x')), "");
}

TEST(ClientChannel, SendsWindowsOverTheLineAndTheRestOverTheChannel) {
  const std::string endpoint = "ipc://" + local_path("both");
  ServerChannel server(endpoint, false);
  DirectLineEntrance entrance(direct_line_path(endpoint));
  ClientChannel client(endpoint);
  client.open_direct_line();
  wait_for(entrance.descriptor());
  auto line = entrance.accept();
  ASSERT_TRUE(line);
  client.send(advance(4));
  wait_for(line->descriptor());
  v1::Request received;
  ASSERT_EQ(line->receive(received), DirectLine::Received::message);
  v1::Reply reply;
  reply.mutable_header()->set_sequence(3);
  ASSERT_NE(line->send(reply), 0U);
  std::array<ClientChannel*, 1> waiting{&client};
  ClientChannel::wait_for_any(waiting, std::chrono::milliseconds(5000));
  const auto answer = client.receive(std::chrono::milliseconds(0));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->header().sequence(), 3U);
  v1::Request stop;
  stop.mutable_stop();
  client.send(stop);
  const auto incoming = server.receive(std::chrono::milliseconds(5000));
  ASSERT_TRUE(incoming && incoming->request);
  EXPECT_TRUE(incoming->request->has_stop());
  // A line that is closed is left: the next Advance takes the channel.
  line.reset();
  EXPECT_FALSE(client.receive(std::chrono::milliseconds(0)));
  client.send(advance(1));
  const auto again = server.receive(std::chrono::milliseconds(5000));
  ASSERT_TRUE(again && again->request);
  EXPECT_TRUE(again->request->has_advance());
}

TEST(LineWatch, SeesWhatComesAndKeepsToItsTimeout) {
  Pair line;
  LineWatch watch;
  std::array<pollfd, 1> watched{{{line.far.descriptor(), POLLIN, 0}}};
  EXPECT_FALSE(watch.wait(watched, std::chrono::milliseconds(20)));
  EXPECT_NE(line.near.send(advance(3)), 0u);
  EXPECT_TRUE(watch.wait(watched, std::nullopt));
  EXPECT_NE(watched[0].revents & POLLIN, 0);
  std::thread writer([&] {
    v1::Request received;
    EXPECT_EQ(line.far.receive(received), DirectLine::Received::message);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_NE(line.near.send(advance(3)), 0u);
  });
  writer.join();
  EXPECT_TRUE(watch.wait(watched, std::nullopt));
}

TEST(LineWatch, SleepsThroughLongWaits) {
  const auto used = [] {
    timespec time{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  Pair line;
  LineWatch watch;
  std::array<pollfd, 1> watched{{{line.far.descriptor(), POLLIN, 0}}};
  const double before = used();
  for (int k = 0; k < 5; ++k) EXPECT_FALSE(watch.wait(watched, std::chrono::milliseconds(20)));
  EXPECT_LT(used() - before, 0.02);  // of 0.1 s
}

}  // namespace
}  // namespace estuary
