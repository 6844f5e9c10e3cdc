// A checkpoint that HDF5 finds nothing wrong with, and that still is not what we write: the reader behind the
// checksum.
//
// The input says which arrays there are: of which type, shape and layout, with which values, or a group or a
// link in their place; HDF5 makes them in memory. Bytes that no HDF5 would write are the business of the
// target hdf5.
//
// Input: a byte for the mark of a checkpoint, then for each of two arrays a byte each for kind, type, shape,
// length, who reads it, and its values as far as there are bytes.
#include <hdf5.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "checkpoint.hpp"

namespace {
hid_t group = -1;  // what is read as if it were the file
}

// The library's own: its public H5Inmembers does not count what the library itself gives out.
extern "C" std::int64_t H5I_nmembers(H5I_type_t kind);

// In the place of the library's, for the reader alone: no disk, and none of the time that opening a file
// takes.
extern "C" hid_t H5Fopen(const char* /*name*/, unsigned /*flags*/, hid_t /*access*/) {
  H5Iinc_ref(group);
  return group;
}
extern "C" herr_t H5Fclose(hid_t file) {
  return H5Idec_ref(file) < 0 ? -1 : 0;
}

namespace {

template <typename Code>
Code sound(Code code) {
  if (code < 0) std::abort();  // of the library's, with what is meant to be right
  return code;
}

hid_t memory_file() {
  const hid_t access = sound(H5Pcreate(H5P_FILE_ACCESS));
  sound(H5Pset_fapl_core(access, std::size_t{1} << 20, false));
  sound(H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST));  // half the time
  const hid_t file = sound(H5Fcreate("checkpoint", H5F_ACC_TRUNC, H5P_DEFAULT, access));
  H5Pclose(access);
  return file;
}

// As large as what `read_all` believes at most: 4 kB.
const std::filesystem::path& name_of_file() {
  static std::string name = "/dev/shm/estuary-fuzz-XXXXXX";
  static const std::filesystem::path path = [] {
    const int opened = ::mkstemp(name.data());
    if (opened < 0 || ::ftruncate(opened, 4096) != 0) std::abort();
    ::close(opened);
    std::atexit([] { ::unlink(name.c_str()); });
    return std::filesystem::path(name);
  }();
  return path;
}

const std::vector<hid_t>& types() {
  static const std::vector<hid_t> all = [] {
    std::vector<hid_t> made{H5T_IEEE_F64LE, H5T_STD_U8LE, H5T_STD_U64LE, H5T_IEEE_F64BE,
                            H5T_IEEE_F32LE, H5T_STD_I8LE, H5T_STD_I64BE, H5T_STD_I64LE,
                            H5T_STD_U32LE,  H5T_STD_B8LE, H5T_STD_B64LE, H5T_C_S1};
    const hid_t variable = H5Tcopy(H5T_C_S1);
    sound(H5Tset_size(variable, H5T_VARIABLE));
    const hid_t eight = H5Tcopy(H5T_C_S1);
    sound(H5Tset_size(eight, 8));
    const hid_t opaque = sound(H5Tcreate(H5T_OPAQUE, 8));
    const hid_t record = sound(H5Tcreate(H5T_COMPOUND, 8));
    sound(H5Tinsert(record, "value", 0, H5T_IEEE_F64LE));
    const hid_t choice = sound(H5Tenum_create(H5T_STD_U8LE));
    const unsigned char one = 1;
    sound(H5Tenum_insert(choice, "one", &one));
    const hsize_t two = 2;
    const hid_t pair = sound(H5Tarray_create2(H5T_IEEE_F64LE, 1, &two));
    const hid_t lists = sound(H5Tvlen_create(H5T_IEEE_F64LE));
    // Eight bytes of another arithmetic: an exponent of 4 bits.
    const hid_t odd = H5Tcopy(H5T_IEEE_F64LE);
    sound(H5Tset_fields(odd, 63, 59, 4, 0, 59));
    sound(H5Tset_ebias(odd, 7));
    made.insert(made.end(), {variable, eight, opaque, record, choice, pair, lists, odd});
    return made;
  }();
  return all;
}

class Input {
public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}
  unsigned byte() {
    if (rest_.empty()) return 0;
    const unsigned value = rest_.front();
    rest_ = rest_.subspan(1);
    return value;
  }
  [[nodiscard]] bool empty() const { return rest_.empty(); }
  // `values` as far as there are bytes, then zeros.
  void fill(std::span<std::uint8_t> values) {
    const std::size_t count = std::min(values.size(), rest_.size());
    std::copy_n(rest_.begin(), count, values.begin());
    rest_ = rest_.subspan(count);
  }

private:
  std::span<const std::uint8_t> rest_;
};

void mark(Input& input) {
  constexpr const char* name = "estuary_checkpoint";
  const unsigned kind = input.byte();
  if (kind == 255) return;
  std::array<std::uint64_t, 2> version{1, 1};
  if (kind >= 128) version[0] = input.byte();
  const hid_t type = kind < 192 ? H5T_STD_U64LE : types()[kind % 12];
  const hsize_t two = 2;
  const hid_t space = kind % 64 == 63 ? H5Screate_simple(1, &two, nullptr)
                                      : H5Screate(kind % 64 == 62 ? H5S_NULL : H5S_SCALAR);
  const hid_t attribute = sound(H5Acreate2(group, name, type, space, H5P_DEFAULT, H5P_DEFAULT));
  if (kind < 192) sound(H5Awrite(attribute, H5T_NATIVE_UINT64, version.data()));
  H5Aclose(attribute);
  H5Sclose(space);
}

constexpr std::array names{"velocity", "pressure"};

void make(Input& input, const char* name) {
  const unsigned kind = input.byte();
  const unsigned type_byte = input.byte();
  const unsigned shape = input.byte();
  const unsigned length = input.byte();
  switch (kind % 32) {
    case 31:
      return;
    case 30:
      H5Gclose(sound(H5Gcreate2(group, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)));
      return;
    case 29:
      sound(H5Lcreate_soft(names[length % names.size()], group, name, H5P_DEFAULT, H5P_DEFAULT));
      return;
    case 28:
      if (H5Lexists(group, names[0], H5P_DEFAULT) > 0 && name != names[0])
        (void)H5Lcreate_hard(group, names[0], group, name, H5P_DEFAULT, H5P_DEFAULT);
      return;
    case 27:
      sound(H5Lcreate_external("none", "/", group, name, H5P_DEFAULT, H5P_DEFAULT));
      return;
    default:
      break;
  }
  const hid_t type = types()[type_byte % types().size()];
  hsize_t extent[2] = {length, 1 + shape / 8 % 3};
  const unsigned form = shape % 8;  // 0 to 3: a list
  if (form == 7) extent[0] = hsize_t{1} << (length % 60);
  const hid_t space = form == 4   ? H5Screate(H5S_SCALAR)
                      : form == 5 ? H5Screate(H5S_NULL)
                                  : H5Screate_simple(form == 6 ? 2 : 1, extent, nullptr);
  hid_t properties = H5P_DEFAULT;
  if ((form == 1 || form == 2) && length > 0) {
    properties = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = std::max<hsize_t>(1, extent[0] / (1 + shape / 64));
    sound(H5Pset_chunk(properties, 1, &chunk));
    if (form == 2 && H5Tget_class(type) != H5T_VLEN && H5Tis_variable_str(type) <= 0)
      sound(H5Pset_fletcher32(properties));
  }
  const hid_t dataset = H5Dcreate2(group, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  if (dataset >= 0 && form < 4 && length > 0 && H5Tget_class(type) != H5T_VLEN &&
      H5Tis_variable_str(type) <= 0) {
    std::vector<std::uint8_t> values(length * H5Tget_size(type));
    input.fill(values);
    sound(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
  }
  if (dataset >= 0) H5Dclose(dataset);
  H5Sclose(space);
  if (properties != H5P_DEFAULT) H5Pclose(properties);
}

void read(const estuary::CheckpointReader& reader, const std::string& name, unsigned how) {
  try {
    const std::size_t length = how / 8;
    switch (how % 5) {
      case 0:
        for (const double value : reader.read_all(name))
          if (!(value - value == 0)) std::abort();  // not finite
        break;
      case 1:
        (void)reader.read_bytes(name);
        break;
      case 2:
        (void)reader.read_count(name);
        break;
      case 3: {
        std::vector<double> values(length);
        reader.read(name, values);
        break;
      }
      default: {
        std::vector<std::uint8_t> values(length);
        reader.read(name, values);
      }
    }
  } catch (const std::runtime_error&) {
  }
}

// Identifiers of whatever kind that are open.
std::array<std::int64_t, 6> open_now() {
  return {H5I_nmembers(H5I_GROUP),   H5I_nmembers(H5I_DATATYPE), H5I_nmembers(H5I_DATASPACE),
          H5I_nmembers(H5I_DATASET), H5I_nmembers(H5I_ATTR),     H5I_nmembers(H5I_GENPROP_LST)};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static hid_t file = memory_file();
  static std::uint64_t executions = 0;
  static const bool silent = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0 && !types().empty();
  if (!silent) std::abort();
  constexpr std::uint64_t files_renewed_after = 20'000;  // what is deleted leaves gaps
  if (++executions % files_renewed_after == 0) {
    H5Idec_ref(file);
    file = memory_file();
  }
  const auto before = open_now();
  group = sound(H5Gcreate_anon(file, H5P_DEFAULT, H5P_DEFAULT));
  Input input(data, size);
  mark(input);
  std::array<unsigned, names.size()> how{};
  for (std::size_t k = 0; k < names.size() && !input.empty(); ++k) {
    how[k] = input.byte();
    make(input, names[k]);
  }
  try {
    const estuary::CheckpointReader reader(name_of_file());
    for (std::size_t k = 0; k < names.size(); ++k) read(reader, names[k], how[k]);
  } catch (const std::runtime_error&) {
  }
  H5Gclose(group);
  if (open_now() != before) std::abort();
  return 0;
}
