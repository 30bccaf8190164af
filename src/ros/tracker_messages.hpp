#pragma once

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <leap_object_tracker/TrackerStatus.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/RegionOfInterest.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "leap_object_tracker/tracking/tracker.hpp"

namespace leap_object_tracker {

/// What the user last asked the tracker to do.
struct TrackerOrder {
  enum class Kind { kStop, kSearch, kStart };
  Kind kind = Kind::kSearch;
  Pose camera_from_object = Pose::Identity();  ///< of kStart
};

/// @param word search, wait, or "x y z qx qy qz qw" @throw std::invalid_argument
TrackerOrder orderFrom(const std::string& word);

geometry_msgs::TransformStamped transformMessage(const PoseEstimate& estimate,
                                                 const std_msgs::Header& header,
                                                 const std::string& object_frame);

geometry_msgs::PoseWithCovarianceStampedPtr poseMessage(const PoseEstimate& estimate,
                                                        const std_msgs::Header& header);

/// All but total_ms, age and dropped.
TrackerStatusPtr statusMessage(const TrackerReport& report, const std_msgs::Header& header,
                               const std::string& object);

/// The mesh, fixed to the object's frame, or its removal.
visualization_msgs::MarkerArrayPtr meshMessage(const ObjectModel& object,
                                               const std::string& object_frame, bool shown);

/// Every n-th particle, so that there are `most` at most.
geometry_msgs::PoseArrayPtr particlesMessage(const std::vector<Pose>& particles, int most,
                                             const std_msgs::Header& header);

/// The object's bounding rectangle in the left rectified image; empty if it is out of view.
sensor_msgs::RegionOfInterestPtr regionMessage(const RectifiedStereoCamera& camera,
                                               const ObjectModel& object,
                                               const Pose& camera_from_object);

/// @param image 8-bit BGR
sensor_msgs::ImagePtr imageMessage(const cv::Mat& image, const std_msgs::Header& header);

}  // namespace leap_object_tracker
