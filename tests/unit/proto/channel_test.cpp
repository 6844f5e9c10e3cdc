#include "channel.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

namespace estuary {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

std::string local_endpoint(const char* name) {
  return "ipc://" + (std::filesystem::temp_directory_path() /
                     (std::string("estuary-") + name + "-" + std::to_string(::getpid())))
                        .string();
}

v1::Request hello(std::uint64_t sequence) {
  v1::Request request;
  request.mutable_header()->set_sequence(sequence);
  request.mutable_hello();
  return request;
}

class Channel : public testing::TestWithParam<std::string> {};

TEST_P(Channel, CarriesARequestThereAndAReplyBack) {
  ServerChannel server(GetParam() == "ipc" ? local_endpoint("there") : "tcp://127.0.0.1:*", false);
  ClientChannel client(server.bound_endpoint());
  client.send(hello(7));
  const auto incoming = server.receive(milliseconds(2000));
  ASSERT_TRUE(incoming && incoming->request);
  EXPECT_EQ(incoming->request->header().sequence(), 7U);
  v1::Reply reply;
  reply.mutable_header()->set_sequence(7);
  auto& displacement = *reply.mutable_advanced()->mutable_outputs()->mutable_displacements();
  for (int i = 0; i < 2000; ++i) displacement.add_displacement(0.1 * i);
  ASSERT_TRUE(server.send(incoming->client, reply));
  const auto received = client.receive(milliseconds(2000));
  ASSERT_TRUE(received);
  EXPECT_EQ(received->SerializeAsString(), reply.SerializeAsString());
  EXPECT_GT(client.bytes_received(), 16000U);
}

INSTANTIATE_TEST_SUITE_P(Transports, Channel, testing::Values("ipc", "tcp"),
                         [](const auto& test) { return test.param; });

TEST(ServerChannel, NothingComesWithinTheDeadline) {
  ServerChannel server(local_endpoint("quiet"), false);
  const auto begin = steady_clock::now();
  EXPECT_FALSE(server.receive(milliseconds(50)));
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(2));
}

TEST(ServerChannel, WakeEndsAWait) {
  ServerChannel server(local_endpoint("wake"), false);
  std::thread waker([&] {
    std::this_thread::sleep_for(milliseconds(30));
    server.wake();
  });
  const auto begin = steady_clock::now();
  EXPECT_FALSE(server.receive(std::chrono::seconds(20)));
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(5));
  waker.join();
}

TEST(ServerChannel, NoticesThatAClientIsGone) {
  ServerChannel server(local_endpoint("gone"), false);
  std::string identity;
  {
    ClientChannel client(server.bound_endpoint());
    client.send(hello(1));
    const auto incoming = server.receive(milliseconds(2000));
    ASSERT_TRUE(incoming);
    identity = incoming->client;
    EXPECT_TRUE(server.send(identity, v1::Reply()));
  }
  bool connected = true;
  for (int i = 0; i < 100 && connected; ++i) {
    std::this_thread::sleep_for(milliseconds(20));
    (void)server.receive(milliseconds(0));
    connected = server.send(identity, v1::Reply());
  }
  EXPECT_FALSE(connected);
}

TEST(ServerChannel, ASecondOneOnTheSameAddressIsRefused) {
  const std::string endpoint = local_endpoint("twice");
  ServerChannel server(endpoint, false);
  EXPECT_THROW(ServerChannel(endpoint, false), ChannelError);
}

TEST(ServerChannel, RefusesAddressesOthersCanReachUnlessToldOtherwise) {
  EXPECT_THROW(ServerChannel("tcp://0.0.0.0:*", false), ChannelError);
  EXPECT_THROW(ServerChannel("udp://127.0.0.1:1", false), ChannelError);
  EXPECT_THROW(ServerChannel("ipc:///" + std::string(200, 'x'), false), ChannelError);
}

TEST(ClientChannel, AnAddressNobodyServesGivesNoReply) {
  ClientChannel client(local_endpoint("nobody"));
  client.send(hello(1));
  EXPECT_FALSE(client.receive(milliseconds(50)));
}

TEST(IsLocal, KnowsLoopback) {
  EXPECT_TRUE(is_local("ipc:///tmp/x"));
  EXPECT_TRUE(is_local("tcp://127.0.0.1:5555"));
  EXPECT_TRUE(is_local("tcp://localhost:5555"));
  EXPECT_TRUE(is_local("tcp://[::1]:5555"));
  EXPECT_FALSE(is_local("tcp://*:5555"));
  EXPECT_FALSE(is_local("tcp://192.168.0.1:5555"));
}

}  // namespace
}  // namespace estuary
