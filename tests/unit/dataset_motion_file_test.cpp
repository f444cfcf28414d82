// SPDX-License-Identifier: MIT
#include "dataset/motion_file.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo::dataset {
namespace {

class MotionFile : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path write(const std::string& text) const {
    return folder_.file("motion.txt", text);
  }
  std::string speed_error(const std::string& text) { return message_of(read_speeds(write(text))); }
  TempFolder folder_;
};

TEST_F(MotionFile, SpeedsStandBetweenCommasOrBlanksAndBringTheirSigma) {
  const auto speeds = read_speeds(write("# time, m/s\n0.1,10\n\n0.2  -1.0 # back\n0.3 4 0.25\n"));
  ASSERT_EQ(speeds->rows.size(), 3U);
  EXPECT_EQ(speeds->rows[0].sigma, 0.2);
  EXPECT_EQ(speeds->rows[1].metres_per_s, -1.0);
  EXPECT_EQ(speeds->rows[1].sigma, 0.05);
  EXPECT_EQ(speeds->rows[2].sigma, 0.25);
}

TEST_F(MotionFile, WhatIsNoRowIsRefusedWithItsLine) {
  EXPECT_THAT(speed_error("0 1\n1\n"),
              HasSubstr("motion.txt:2: expected a time, m/s and maybe a sigma, found 1 words"));
  EXPECT_THAT(speed_error("time speed\n"), HasSubstr("motion.txt:1: expected"));
  EXPECT_THAT(speed_error("1 1\n\n1 2\n"), HasSubstr("motion.txt:3: expected a time after 1 s"));
  EXPECT_THAT(speed_error("0 1\n1 1 0\n"), HasSubstr("expected a sigma above 0 at 1 s, found 0"));
  EXPECT_THAT(speed_error("0 nan\n"), HasSubstr("motion.txt:1"));
  EXPECT_THAT(speed_error("# nothing\n"), HasSubstr("expected rows of a time, m/s"));
  EXPECT_THAT(message_of(read_gyro(write("0 1 2\n"))),
              HasSubstr("motion.txt:1: expected a time and rad/s"));
}

TEST_F(MotionFile, OtherUnitsThatACommentNamesAreRefused) {
  EXPECT_THAT(speed_error("# t, speed [km/h]\n0 36\n"),
              HasSubstr("motion.txt:1: expected m/s, found km/h"));
  EXPECT_TRUE(read_speeds(write("# m/s, from km/h\n0 10\n")));
  for (const char* unit : {"cm/s", "mm / s", "km / h", "[km h-1]", "kilometers per hour", "mph"}) {
    EXPECT_THAT(speed_error(fmt::format("# speed {}\n0 36\n", unit)), HasSubstr("expected m/s"));
  }
  EXPECT_THAT(message_of(read_gyro(write("0 1 2 3\n# deg/s\n"))),
              HasSubstr("motion.txt:2: expected rad/s, found deg"));
  EXPECT_TRUE(read_gyro(write("# t, rad s^-1, temperature in deg C\n0 1 2 3\n")));
}

TEST_F(MotionFile, ColumnsInAnotherOrderAreRefused) {
  const auto error_of = [&](const std::string& names) {
    return message_of(read_gyro(write(fmt::format("# of the head\n# {}\n1 2 3 4 5 6 7\n", names))));
  };
  for (const char* names :
       {"timestamp,ax,ay,az,gx,gy,gz", "t acc_x acc_y acc_z gyro_x gyro_y gyro_z", "time wz wy wx",
        "time,wy,wx,wz", "time, acceleration x, y, z, rate x, y, z",
        "timestamp [ns],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2],w_RS_S_x [rad s^-1]",
        "time,linear_acceleration.x,linear_acceleration.y,linear_acceleration.z"}) {
    EXPECT_THAT(error_of(names),
                HasSubstr("motion.txt:2: expected columns of time, rates about x, y and z, found"))
        << names;
  }
  for (const char* names :
       {"timestamp,gx,gy,gz,ax,ay,az", "t wx wy wz", "time (s), rate about x, y, z (rad/s)",
        "Stamp, angular_velocity.x, angular_velocity.y, angular_velocity.z, linear_acceleration.x",
        "made by my phone, a gyro alone", "recorded 2024-01-01T12:00:00Z", "z up", "by Y. Tanaka",
        "time in s, gyro x y z in rad/s, accelerometer x y z",
        "timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y,w_RS_S_z,a_RS_S_x,a_RS_S_y,a_RS_S_z"}) {
    EXPECT_EQ(error_of(names), "no error") << names;
  }
  EXPECT_THAT(message_of(read_gyro(write("# wx,wy,wz,time\n0.1,0.2,0.3,1\n0.1,0.2,0.3,2\n"))),
              HasSubstr("motion.txt:3: expected a time after 0.1 s"));
  EXPECT_THAT(speed_error("# time vx vy\n0 1 1\n"), HasSubstr("expected columns of time, speed"));
  EXPECT_THAT(speed_error("# t, sigma, v\n0 1 1\n"), HasSubstr("expected columns of time, speed"));
  for (const char* names : {"time, speed, sigma of velocity", "time,speed,sigma_speed",
                            "t [s], v [m/s], std_v [m/s]", "time, v, std (varies)"}) {
    EXPECT_TRUE(read_speeds(write(fmt::format("# {}\n0 1 1\n", names)))) << names;
  }
}

TEST_F(MotionFile, EurocsTimesAreNanoseconds) {
  const auto gyro = read_gyro(
      write("#timestamp [ns],w_x [rad s^-1],w_y,w_z,a_x,a_y,a_z\n2500000000,0.1,0.2,0.3,9,8,7\n"));
  EXPECT_NEAR(gyro->rows.front().time_s, 2.5, 1e-12);
  EXPECT_EQ(gyro->rows.front().rad_per_s, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(gyro->note, "") << "the file says the unit itself";
  EXPECT_THAT(read_speeds(write("0 1\n100000 1\n"))->note,
              HasSubstr("motion.txt: times are taken for microseconds, by their steps"));
}

TEST_F(MotionFile, UnitsOfFastAndSlowRows) {
  const auto rows = [](double first, double step, int count, const char* rest) {
    std::string text;
    for (int i = 0; i < count; ++i) {
      text += fmt::format("{:.0f} {}\n", first + step * i, rest);
    }
    return text;
  };
  const auto gyro_step = [&](double first, double step) {
    const auto gyro = read_gyro(write(rows(first, step, 9, "1 2 3")));
    return gyro->rows[3].time_s - gyro->rows[2].time_s;
  };
  EXPECT_NEAR(gyro_step(1.7e18, 2.5e6), 0.0025, 1e-5) << "400 Hz in ns";
  EXPECT_NEAR(gyro_step(0, 2500), 0.0025, 1e-12) << "in us";
  EXPECT_NEAR(gyro_step(1.7e12, 2), 0.002, 1e-6) << "500 Hz in ms";
  const auto speed_end = [&](double first, double step, std::pair<double, double> span_s) {
    return read_speeds(write(rows(first, step, 7, "5")), span_s)->rows.back().time_s;
  };
  EXPECT_EQ(speed_end(0, 5, {0, 29}), 30.0);
  EXPECT_NEAR(speed_end(0, 5000, {0, 29}), 30.0, 1e-9) << "ms";
  EXPECT_NEAR(speed_end(0, 2000, {0, 0.01}), 0.012, 1e-9) << "500 Hz in us";
  EXPECT_THAT(speed_error(rows(0, 2000, 7, "5")),
              HasSubstr("found steps of 2000, milliseconds or microseconds"));
}

TEST(Gyro, RatesBecomeTheRotationBetweenTwoTimes) {
  std::vector<GyroRow> rows;  // faster and faster about x
  for (int i = 0; i <= 40; ++i) {
    rows.push_back({0.05 * i, Eigen::Vector3d(0.5 * 0.05 * i, 0.0, 0.0)});
  }
  const auto turned = integrate_gyro(rows, 0.52, 0.97).value();
  const double angle = 0.25 * (0.97 * 0.97 - 0.52 * 0.52);
  EXPECT_LT(turned.angularDistance(so3_exp({angle, 0.0, 0.0})), 1e-9);
  EXPECT_FALSE(integrate_gyro(rows, 1.9, 2.2)) << "behind the last";
  EXPECT_FALSE(integrate_gyro({}, 0.0, 0.1));
  rows.erase(rows.begin() + 15, rows.begin() + 20);
  EXPECT_FALSE(integrate_gyro(rows, 0.6, 1.1)) << "a gap";
  EXPECT_TRUE(integrate_gyro(rows, 1.1, 1.4));
}

// Turns do not commute: first about y, then about the new z.
TEST(Gyro, TurnsAreTakenInTheirOrder) {
  std::vector<GyroRow> rows;
  for (int i = 0; i <= 200; ++i) {
    const bool is_first = i < 100;
    rows.push_back({0.001 * i, is_first ? Eigen::Vector3d(0, 5, 0) : Eigen::Vector3d(0, 0, 5)});
  }
  const auto turned = integrate_gyro(rows, 0.0, 0.2).value();
  EXPECT_LT(turned.angularDistance(so3_exp({0.0, 0.5, 0.0}) * so3_exp({0.0, 0.0, 0.5})), 0.005);
}

}  // namespace
}  // namespace stemvo::dataset
