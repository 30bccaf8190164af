#include "tracker_messages.hpp"

#include <cv_bridge/cv_bridge.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>

#include "conversions.hpp"

namespace leap_object_tracker {

TrackerOrder orderFrom(const std::string& word) {
  if (word == "search") return {TrackerOrder::Kind::kSearch, Pose::Identity()};
  if (word == "wait") return {TrackerOrder::Kind::kStop, Pose::Identity()};
  try {
    return {TrackerOrder::Kind::kStart, poseFrom(word)};
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("start: neither 'search' nor 'wait', nor a " +
                                std::string(error.what()));
  }
}

geometry_msgs::TransformStamped transformMessage(const PoseEstimate& estimate,
                                                 const std_msgs::Header& header,
                                                 const std::string& object_frame) {
  const geometry_msgs::Pose pose = messageFrom(estimate.camera_from_object);
  geometry_msgs::TransformStamped message;
  message.header = header;
  message.child_frame_id = object_frame;
  message.transform.translation.x = pose.position.x;
  message.transform.translation.y = pose.position.y;
  message.transform.translation.z = pose.position.z;
  message.transform.rotation = pose.orientation;
  return message;
}

geometry_msgs::PoseWithCovarianceStampedPtr poseMessage(const PoseEstimate& estimate,
                                                        const std_msgs::Header& header) {
  auto message = boost::make_shared<geometry_msgs::PoseWithCovarianceStamped>();
  message->header = header;
  message->pose.pose = messageFrom(estimate.camera_from_object);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message->pose.covariance.data()) =
      estimate.covariance;
  return message;
}

TrackerStatusPtr statusMessage(const TrackerReport& report, const std_msgs::Header& header,
                               const std::string& object) {
  auto message = boost::make_shared<TrackerStatus>();
  message->header = header;
  switch (report.state) {
    case TrackerState::kIdle:
      message->state = TrackerStatus::IDLE;
      break;
    case TrackerState::kSearching:
      message->state = TrackerStatus::SEARCHING;
      break;
    case TrackerState::kTracking:
      message->state = TrackerStatus::TRACKING;
      break;
    case TrackerState::kLost:
      message->state = TrackerStatus::LOST;
      break;
  }
  message->object = object;
  message->support = report.support;
  message->unclear = report.unclear;
  message->effective_share = report.effective_share;
  message->particles = static_cast<std::uint32_t>(report.particles);
  message->edges_ms = report.edges_ms;
  message->filter_ms = report.filter_ms;
  message->search_ms = report.search_ms;
  return message;
}

visualization_msgs::MarkerArrayPtr meshMessage(const ObjectModel& object,
                                               const std::string& object_frame, bool shown) {
  visualization_msgs::Marker marker;
  marker.header.frame_id = object_frame;  // stamp zero: wherever the object is now
  marker.frame_locked = 1;
  marker.ns = object.name;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.action = shown ? visualization_msgs::Marker::ADD : visualization_msgs::Marker::DELETE;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = 1;
  marker.color.r = 0.4F;
  marker.color.g = 1.0F;
  marker.color.b = 0.5F;
  marker.color.a = 0.7F;
  if (shown)
    for (const auto& triangle : object.mesh.triangles)
      for (const auto index : triangle) {
        const Eigen::Vector3d& vertex = object.mesh.vertices[index];
        geometry_msgs::Point point;
        point.x = vertex.x();
        point.y = vertex.y();
        point.z = vertex.z();
        marker.points.push_back(point);
      }
  auto message = boost::make_shared<visualization_msgs::MarkerArray>();
  message->markers.push_back(marker);
  return message;
}

geometry_msgs::PoseArrayPtr particlesMessage(const std::vector<Pose>& particles, int most,
                                             const std_msgs::Header& header) {
  auto message = boost::make_shared<geometry_msgs::PoseArray>();
  message->header = header;
  const std::size_t step = (particles.size() + static_cast<std::size_t>(std::max(1, most)) - 1) /
                           static_cast<std::size_t>(std::max(1, most));
  for (std::size_t i = 0; most > 0 && i < particles.size(); i += std::max<std::size_t>(1, step))
    message->poses.push_back(messageFrom(particles[i]));
  return message;
}

sensor_msgs::RegionOfInterestPtr regionMessage(const RectifiedStereoCamera& camera,
                                               const ObjectModel& object,
                                               const Pose& camera_from_object) {
  Eigen::AlignedBox3d box;
  for (const auto& vertex : object.mesh.vertices) box.extend(vertex);
  Eigen::AlignedBox2d seen;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d point =
        camera_from_object * box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    point.z() = std::max(point.z(), 1e-3);
    seen.extend(camera.leftPixel(point));
  }
  const Eigen::AlignedBox2d image(Eigen::Vector2d::Zero(),
                                  Eigen::Vector2d(camera.size.width, camera.size.height));
  seen = seen.intersection(image);
  auto message = boost::make_shared<sensor_msgs::RegionOfInterest>();
  if (seen.isEmpty()) return message;
  message->x_offset = static_cast<std::uint32_t>(seen.min().x());
  message->y_offset = static_cast<std::uint32_t>(seen.min().y());
  message->width = static_cast<std::uint32_t>(std::ceil(seen.sizes().x()));
  message->height = static_cast<std::uint32_t>(std::ceil(seen.sizes().y()));
  message->do_rectify = 1;
  return message;
}

sensor_msgs::ImagePtr imageMessage(const cv::Mat& image, const std_msgs::Header& header) {
  return cv_bridge::CvImage(header, "bgr8", image).toImageMsg();
}

}  // namespace leap_object_tracker
