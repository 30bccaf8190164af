#include "leap_object_tracker/leap/leap_calibration.hpp"

#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "leap_object_tracker/leap/distortion_fit.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::uint32_t kFirstPlausibleTime = 1325376000;  // 2012-01-01
constexpr double kHalfColumns640 = 320, kHalfColumns752 = 376, kHalfRows = 240;
constexpr double kCalibratedRows = 480;

/// Takes values from a packed little-endian record, one after the other.
class RecordReader {
 public:
  explicit RecordReader(ByteView bytes) : bytes_(bytes) {}
  std::uint8_t byte() { return bytes_[at_++]; }
  std::uint32_t word() {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(bytes_[at_++]) << (8 * i);
    return value;
  }
  double real() {
    const std::uint32_t bits = word();
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

 private:
  ByteView bytes_;
  std::size_t at_ = 0;
};

LeapEyeRecord readEye(RecordReader& reader) {
  LeapEyeRecord eye;
  eye.focal_length = reader.real();
  eye.offset_u = reader.real();
  eye.offset_v = reader.real();
  eye.p1 = reader.real();
  eye.p2 = reader.real();
  for (double& k : eye.radial) k = reader.real();
  eye.rectified_focal_length = reader.real();
  eye.rectified_offset_u = reader.real();
  eye.rectified_offset_v = reader.real();
  for (int i = 0; i < 3; ++i) eye.rotation[i] = reader.real();
  return eye;
}

void require(bool holds, const std::string& which) {
  if (!holds)
    throw std::invalid_argument("calibration in the device's memory: " + which +
                                "; use a calibration file of your own instead");
}

void requireBetween(double value, double low, double high, const std::string& which) {
  std::ostringstream text;
  text << which << " is " << value << ", expected " << low << " to " << high;
  require(std::isfinite(value) && low <= value && value <= high, text.str());
}

void checkEye(const LeapEyeRecord& eye, const std::string& side) {
  requireBetween(eye.focal_length, 110, 150, side + " focal length [px]");
  requireBetween(eye.offset_u, -40, 40, side + " centre offset u [px]");
  requireBetween(eye.offset_v, -40, 40, side + " centre offset v [px]");
  requireBetween(eye.p1, -0.02, 0.02, side + " p1");
  requireBetween(eye.p2, -0.02, 0.02, side + " p2");
  for (std::size_t i = 0; i < eye.radial.size(); ++i)
    requireBetween(eye.radial[i], -10, 10, side + " k" + std::to_string(i + 1));
  requireBetween(eye.rectified_focal_length, 110, 150, side + " rectified focal length [px]");
  requireBetween(eye.rectified_offset_u, -60, 60, side + " rectified offset u [px]");
  requireBetween(eye.rectified_offset_v, -60, 60, side + " rectified offset v [px]");
  for (int i = 0; i < 3; ++i) requireBetween(eye.rotation[i], -0.05, 0.05, side + " rotation");
  // The lens is monotone to the corners of the widest mode, or no picture can be rectified.
  double previous = 0;
  for (double r = 0.05; r < 3.6; r += 0.05) {
    const double t = r * r;
    const auto& k = eye.radial;
    const double ray =
        r * (1 + t * (k[0] + t * (k[1] + t * k[2]))) / (1 + t * (k[3] + t * (k[4] + t * k[5])));
    require(std::isfinite(ray) && ray > previous,
            side + " radial distortion turns back at r = " + std::to_string(r));
    previous = ray;
  }
}

/// Rotation of the Cayley map, by about twice |q| [rad].
Eigen::Matrix3d cayley(const Eigen::Vector3d& q) {
  return Eigen::Quaterniond(1, q.x(), q.y(), q.z()).normalized().toRotationMatrix();
}

CameraCalibration eyeCalibration(const LeapEyeRecord& eye, const LeapModeInfo& mode,
                                 CalibrationConvention convention) {
  const double binned = mode.size.height / kCalibratedRows;
  CameraCalibration camera;
  camera.size = mode.size;
  camera.fx = eye.focal_length;
  camera.fy = eye.focal_length * binned;
  camera.cx = (mode.size.width == 752 ? kHalfColumns752 : kHalfColumns640) + eye.offset_u;
  camera.cy = (kHalfRows + eye.offset_v + 0.5) * binned - 0.5;
  camera.distortion_model = DistortionModel::kLeapInverse;
  camera.distortion.assign(eye.radial.begin(), eye.radial.end());
  const bool tangential_to_ray = convention == CalibrationConvention::kRecommended;
  camera.distortion.push_back(tangential_to_ray ? eye.p1 : 0);
  camera.distortion.push_back(tangential_to_ray ? eye.p2 : 0);

  const Eigen::Vector3d& rho = eye.rotation;
  switch (convention) {
    case CalibrationConvention::kRecommended:
      camera.rectified_from_raw = cayley(0.5 * Eigen::Vector3d(-rho.x(), rho.y(), -rho.z()));
      break;
    case CalibrationConvention::kLeapuvc: {
      camera = fitRationalPolynomial(camera, FitFreedom::kRadialPart).camera;
      camera.distortion[2] = eye.p1;
      camera.distortion[3] = eye.p2;
      camera.rectified_from_raw = cayley(-rho);
      break;
    }
    case CalibrationConvention::kNone:
      break;
  }
  return camera;
}

}  // namespace

std::optional<CalibrationConvention> calibrationConventionFromName(const std::string& text) {
  for (const CalibrationConvention convention :
       {CalibrationConvention::kRecommended, CalibrationConvention::kLeapuvc,
        CalibrationConvention::kNone})
    if (text == name(convention)) return convention;
  return std::nullopt;
}

const char* name(CalibrationConvention convention) {
  switch (convention) {
    case CalibrationConvention::kRecommended:
      return "recommended";
    case CalibrationConvention::kLeapuvc:
      return "leapuvc";
    case CalibrationConvention::kNone:
      return "none";
  }
  return "";
}

bool calibrationChecksumHolds(ByteView bytes) {
  if (bytes.size != kCalibrationBytes) return false;
  RecordReader reader(bytes);
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 4 < kCalibrationBytes; i += 4) sum += reader.word();
  return sum == reader.word();
}

LeapCalibrationRecord parseCalibration(ByteView bytes) {
  require(bytes.size == kCalibrationBytes, "it has " + std::to_string(bytes.size) +
                                               " bytes instead of " +
                                               std::to_string(kCalibrationBytes));
  require(bytes[0] == 'C' && bytes[1] == 'A', "it does not begin with \"CA\"");
  require(calibrationChecksumHolds(bytes), "the checksum does not match");

  RecordReader reader(bytes);
  reader.byte();
  reader.byte();
  LeapCalibrationRecord record;
  record.version = reader.byte();
  record.score = reader.byte();
  record.unix_time = reader.word();
  record.baseline_mm = reader.real();
  record.center_shift = reader.real();
  record.left = readEye(reader);
  record.right = readEye(reader);

  requireBetween(record.baseline_mm, 35, 45, "baseline [mm]");
  require(std::isfinite(record.center_shift), "the shift of the centres is not a number");
  checkEye(record.left, "left");
  checkEye(record.right, "right");
  return record;
}

std::vector<std::string> calibrationWarnings(const LeapCalibrationRecord& record) {
  std::vector<std::string> warnings;
  if (record.version != 0)
    warnings.push_back("calibration version " + std::to_string(record.version) +
                       " is not known (0 is); the numbers may mean something else");
  if (record.unix_time < kFirstPlausibleTime)
    warnings.push_back("the calibration is dated before the device was made");
  const double shift =
      (record.right.rectified_offset_u - record.left.rectified_offset_u) / record.baseline_mm;
  if (std::abs(shift - record.center_shift) > 1e-4)
    warnings.push_back("the rectified centres contradict each other");
  return warnings;
}

StereoCalibration stereoCalibration(const LeapCalibrationRecord& record, LeapMode mode,
                                    CalibrationConvention convention) {
  StereoCalibration calibration;
  calibration.left = eyeCalibration(record.left, leapModeInfo(mode), convention);
  calibration.right = eyeCalibration(record.right, leapModeInfo(mode), convention);
  calibration.baseline = record.baseline_mm / 1000;
  return calibration;
}

}  // namespace leap_object_tracker
