// Numbers of a fuzzer's bytes, and the arms, gears and poses made of them.
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include <array>
#include <cmath>
#include <limits>

#include "exactarm/base/check.hpp"
#include "exactarm/robot/robot.hpp"

namespace exactarm::fuzz {

constexpr long kMostRows = 20;
constexpr int kMostOrders = 6;

class Numbers {
 public:
  Numbers(const uint8_t* data, size_t size) : data_(data, size) {}

  int whole(int low, int high) { return data_.ConsumeIntegralInRange<int>(low, high); }
  bool flag() { return data_.ConsumeBool(); }

  // Half of the numbers are of a usual size, the others anything that a double can be.
  double number() {
    constexpr std::array<double, 8> special = {0.0,
                                               -0.0,
                                               1e300,
                                               -1e300,
                                               5e-324,
                                               std::numeric_limits<double>::infinity(),
                                               std::numeric_limits<double>::quiet_NaN(),
                                               1e9};
    switch (data_.ConsumeIntegralInRange<int>(0, 7)) {
      case 0: return special[data_.ConsumeIntegralInRange<size_t>(0, special.size() - 1)];
      case 1: return data_.ConsumeFloatingPoint<double>();
      case 2: return data_.ConsumeFloatingPointInRange<double>(-1e4, 1e4);
      default: return data_.ConsumeFloatingPointInRange<double>(-2.0, 2.0);
    }
  }

  Vector vector(long size) {
    Vector values(size);
    for (long i = 0; i < size; ++i) values[i] = number();
    return values;
  }

  RowMatrix matrix(long rows, long columns) {
    RowMatrix values(rows, columns);
    for (long i = 0; i < values.size(); ++i) values.data()[i] = number();
    return values;
  }

  GearTable table() {
    const long orders = whole(0, kMostOrders);
    return {vector(flag() ? orders : whole(0, kMostOrders)).cwiseAbs(), vector(orders) * 0.1,
            vector(orders) * 0.1};
  }

  Gear gear() { return {flag() ? 50.0 : number(), table(), table()}; }
  Spring spring() { return {flag() ? 1e4 : number(), flag() ? 0.0 : number()}; }
  Pose pose() {
    Pose found;
    if (flag()) found.rotation = Eigen::Map<const Matrix3>(vector(9).data());
    found.position = vector(3);
    return found;
  }

  RobotDescription description() {
    RobotDescription found;
    const bool masses = flag();
    for (int axes = whole(0, 8); axes > 0; --axes) {
      Joint joint;
      joint.frame = {flag() ? JointType::revolute : JointType::prismatic,
                     flag() ? 1.0 : number(),
                     number(),
                     number(),
                     number(),
                     number(),
                     flag() ? 0.0 : number()};
      joint.q_offset = number();
      if (flag()) joint.gear = gear();
      joint.spring = spring();
      joint.drive.rotor_inertia = number();
      if (flag()) joint.limits = {number(), number(), number(), number(), number()};
      if (masses) joint.link = LinkInertia{number(), vector(3), Eigen::Map<const Matrix3>(vector(9).data())};
      found.joints.push_back(joint);
    }
    found.base = pose();
    found.tool = pose();
    found.gravity = vector(3);
    return found;
  }

 private:
  FuzzedDataProvider data_;
};

// What one input is used for; it returns, or throws InvalidArgument.
using Entry = void (*)(Numbers&);

template <std::size_t count>
int run(const std::array<Entry, count>& entries, const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  Numbers from(data + 1, size - 1);
  try {
    entries[data[0] % count](from);
  } catch (const InvalidArgument&) {
  }
  return 0;
}

}  // namespace exactarm::fuzz
