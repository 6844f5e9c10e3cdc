// Checkpoints come back bit for bit; damaged, foreign and unfinished ones are refused by name.
#include "checkpoint.hpp"

#include <gmock/gmock.h>
#include <hdf5.h>

#include <bit>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "crc32_by_bits.hpp"
#include "file_digest.hpp"
#include "temporary_folder.hpp"

namespace estuary {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class Checkpoint : public ::testing::Test {
protected:
  void write(std::span<const double> values) const {
    CheckpointWriter writer(file_);
    writer.add("populations", values);
    writer.commit();
  }

  estuary::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "solid.h5";
};

template <typename Action>
std::string failure(Action action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST_F(Checkpoint, GivesBackEveryBit) {
  const std::vector<double> values{0.0,
                                   -0.0,
                                   1.0 / 3.0,
                                   std::numeric_limits<double>::denorm_min(),
                                   std::numeric_limits<double>::max(),
                                   -std::nextafter(1.0, 2.0)};
  const std::vector<std::uint8_t> flags{0, 1, 255};
  {
    CheckpointWriter writer(file_);
    writer.add("populations", values);
    writer.add("flags", flags);
    writer.add("nothing", std::span<const double>{});
    writer.add("steps", std::numeric_limits<std::uint64_t>::max());
    writer.commit();
  }
  const CheckpointReader reader(file_);
  std::vector<double> values_read(values.size());
  std::vector<std::uint8_t> flags_read(flags.size());
  reader.read("populations", values_read);
  reader.read("flags", flags_read);
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(std::bit_cast<std::uint64_t>(values_read[i]), std::bit_cast<std::uint64_t>(values[i])) << i;
  }
  EXPECT_EQ(flags_read, flags);
  EXPECT_EQ(reader.read_all("populations"), values);
  EXPECT_TRUE(reader.read_all("nothing").empty());
  EXPECT_EQ(reader.read_count("steps"), std::numeric_limits<std::uint64_t>::max());
}

TEST_F(Checkpoint, HoldsArraysOfManyChunks) {
  std::vector<double> values(300'001);
  std::iota(values.begin(), values.end(), 0.5);
  write(values);
  EXPECT_EQ(CheckpointReader(file_).read_all("populations"), values);
}

TEST_F(Checkpoint, NamesAMissingArray) {
  write(std::vector<double>{1.0});
  const CheckpointReader reader(file_);
  EXPECT_THAT(failure([&] { static_cast<void>(reader.read_count("steps")); }),
              AllOf(HasSubstr("solid.h5"), HasSubstr("no array 'steps'")));
  EXPECT_THAT(failure([&] { static_cast<void>(reader.read_all("steps")); }), HasSubstr("no array 'steps'"));
}

TEST_F(Checkpoint, RefusesAnotherLengthAndAnotherType) {
  write(std::vector<double>{1.0, 2.0, 3.0});
  const CheckpointReader reader(file_);
  std::vector<double> two(2);
  EXPECT_THAT(failure([&] { reader.read("populations", two); }),
              HasSubstr("has 3 values; this scene needs 2"));
  std::vector<std::uint8_t> bytes(3);
  EXPECT_THAT(failure([&] { reader.read("populations", bytes); }), HasSubstr("another type"));
}

TEST_F(Checkpoint, RefusesAStateThatIsNotFinite) {
  write(std::vector<double>{1.0, std::numeric_limits<double>::quiet_NaN()});
  const CheckpointReader reader(file_);
  std::vector<double> values(2);
  EXPECT_THAT(failure([&] { reader.read("populations", values); }),
              HasSubstr("value 1 of array 'populations' is nan"));
  EXPECT_THAT(failure([&] { static_cast<void>(reader.read_all("populations")); }), HasSubstr("is nan"));
}

TEST_F(Checkpoint, KeepsTheOlderFileUntilCommitted) {
  write(std::vector<double>{1.0});
  {
    CheckpointWriter writer(file_);
    writer.add("populations", std::vector<double>{2.0});
    EXPECT_EQ(CheckpointReader(file_).read_all("populations"), std::vector<double>{1.0});
  }
  EXPECT_EQ(CheckpointReader(file_).read_all("populations"), std::vector<double>{1.0});
  const auto files = std::distance(std::filesystem::directory_iterator(folder_.path()), {});
  EXPECT_EQ(files, 1) << "an abandoned checkpoint leaves nothing behind";
  write(std::vector<double>{2.0});
  EXPECT_EQ(CheckpointReader(file_).read_all("populations"), std::vector<double>{2.0});
}

TEST_F(Checkpoint, RefusesOneNameTwiceAndASecondCommit) {
  CheckpointWriter writer(file_);
  writer.add("a", std::uint64_t{1});
  EXPECT_THAT(failure([&] { writer.add("a", std::uint64_t{2}); }), HasSubstr("array 'a'"));
  writer.commit();
  EXPECT_THAT(failure([&] { writer.commit(); }), HasSubstr("committed before"));
}

TEST_F(Checkpoint, NoticesADamagedByte) {
  const std::vector<double> values(4096, 3.25);
  write(values);
  // The bytes of the values themselves: damage there is invisible without a checksum.
  std::fstream stream(file_, std::ios::in | std::ios::out | std::ios::binary);
  const std::string content((std::istreambuf_iterator<char>(stream)), {});
  const double value = 3.25;
  const std::string pattern(reinterpret_cast<const char*>(&value), sizeof value);
  const auto place = content.find(pattern + pattern);
  ASSERT_NE(place, std::string::npos);
  stream.clear();
  stream.seekp(static_cast<std::streamoff>(place + 3));
  stream.put('\x5a');
  stream.close();
  const CheckpointReader reader(file_);
  EXPECT_THAT(failure([&] { static_cast<void>(reader.read_all("populations")); }),
              HasSubstr("array 'populations' cannot be read"));
}

TEST_F(Checkpoint, RefusesWhatIsNoCheckpoint) {
  EXPECT_THAT(failure([&] { const CheckpointReader reader(file_); }),
              AllOf(HasSubstr("solid.h5"), HasSubstr("cannot be opened")));
  std::ofstream(file_) << "text";
  EXPECT_THAT(failure([&] { const CheckpointReader reader(file_); }), HasSubstr("cannot be opened"));
  const hid_t other = H5Fcreate(file_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  ASSERT_GE(other, 0);
  H5Fclose(other);
  EXPECT_THAT(failure([&] { const CheckpointReader reader(file_); }), HasSubstr("is not a checkpoint"));
}

TEST_F(Checkpoint, RefusesATruncatedFile) {
  write(std::vector<double>(100'000, 1.0));
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) / 2);
  EXPECT_NE(failure([&] { static_cast<void>(CheckpointReader(file_).read_all("populations")); }), "");
}

TEST_F(Checkpoint, NamesAFileThatCannotBeWritten) {
  CheckpointWriter writer(folder_.path() / "no-such-folder" / "a.h5");
  EXPECT_THAT(failure([&] { writer.commit(); }),
              AllOf(HasSubstr("no-such-folder/a.h5"), HasSubstr("cannot be created")));
}

TEST_F(Checkpoint, ItsChecksumIsThatOfTheStandard) {
  constexpr std::string_view check = "123456789";  // the standard's own example
  EXPECT_EQ(crc32_of(check.data(), check.size()), 0xcbf43926U);
  EXPECT_EQ(crc32_by_bits(check), 0xcbf43926U);
  // In one piece, in several pieces as files are read, and around their ends.
  for (const std::size_t size : {0, 1, 65'535, 65'536, 65'537, 200'000}) {
    std::string bytes(size, '\0');
    for (std::size_t k = 0; k < size; ++k) bytes[k] = static_cast<char>(k * k / 7 + k);
    std::ofstream(file_, std::ios::binary) << bytes;
    const FileSum sum = sum_of_file(file_);
    EXPECT_EQ(sum.bytes, size);
    EXPECT_EQ(sum.crc32, crc32_by_bits(bytes)) << size;
    EXPECT_EQ(crc32_of(bytes.data(), size), sum.crc32) << size;
    if (size == 0) continue;
    bytes[size / 2] = static_cast<char>(bytes[size / 2] ^ 4);
    std::ofstream(file_, std::ios::binary) << bytes;
    EXPECT_THAT(failure([&] { require_sum(file_, sum); }), HasSubstr("is damaged: its checksum is")) << size;
  }
}

}  // namespace
}  // namespace estuary
