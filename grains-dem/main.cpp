#include "grains.hpp"
#include "serve.hpp"

int main(int argc, char** argv) {
  return estuary::serve(argc, argv, std::make_unique<estuary::grains::Grains>());
}
