// The sample count of the randomised tests is an argument: --samples=1000; the seed is printed.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "random_states.hpp"

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.rfind("--samples=", 0) == 0) exactarm::testing::samples() = std::stoi(argument.substr(10));
    if (argument.rfind("--seed=", 0) == 0) exactarm::testing::seed() = std::stoul(argument.substr(7));
  }
  std::printf("samples %d, seed %lu\n", exactarm::testing::samples(), exactarm::testing::seed());
  return RUN_ALL_TESTS();
}
