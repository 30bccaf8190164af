#include <gtest/gtest.h>

#include "emulated_leap_bus.hpp"

int main(int argument_count, char** arguments) {
  leap_object_tracker::restartWithUmockdev(arguments);
  testing::InitGoogleTest(&argument_count, arguments);
  return RUN_ALL_TESTS();
}
