// HDF5 alone, to tell its leaks from ours: opens a file three times, which is refused.
//   clang -fsanitize=address -I/usr/include/hdf5/serial tests/fuzz/hdf5_alone.c
//   -L/usr/lib/x86_64-linux-gnu/hdf5/serial -lhdf5 ASAN_OPTIONS=fast_unwind_on_malloc=0 ./a.out
//   tests/fuzz/corpus/hdf5/leak-of-hdf5.h5
// HDF5 1.10.8 loses 56 bytes each time: a message of the root group's header, in H5O_protect below H5Fopen.
#include <hdf5.h>
#include <stdio.h>

int main(int count, char** words) {
  if (count != 2) return 2;
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  for (int k = 0; k < 3; ++k) {
    const hid_t file = H5Fopen(words[1], H5F_ACC_RDONLY, H5P_DEFAULT);
    printf("%s; open: %ld\n", file < 0 ? "refused" : "accepted",
           (long)H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL));
    if (file >= 0) H5Fclose(file);
  }
  return 0;
}
