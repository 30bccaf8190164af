#pragma once

#include <gtest/gtest.h>
#include <leap_object_tracker/TrackerStatus.h>
#include <nodelet/loader.h>
#include <ros/console.h>
#include <ros/ros.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace leap_object_tracker {

/// Waits until something holds, at most `seconds`. @return whether it does
inline bool eventually(const std::function<bool()>& holds, double seconds = 20) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    ros::WallDuration(0.002).sleep();
  }
  return true;
}

/// Messages of one topic, kept in their order.
template <class Message>
class Inbox {
 public:
  Inbox(ros::NodeHandle& nh, const std::string& topic) {
    subscriber_ =
        nh.subscribe<Message>(topic, 1000, [this](const boost::shared_ptr<Message const>& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          messages_.push_back(*message);
        });
  }
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }
  std::vector<Message> messages() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  bool connected() const { return subscriber_.getNumPublishers() > 0; }

 private:
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  ros::Subscriber subscriber_;
};

/// What the process logs, from construction on.
class LogRecorder : public ros::console::LogAppender {
 public:
  LogRecorder() { ros::console::register_appender(this); }
  ~LogRecorder() override { ros::console::deregister_appender(this); }

  void log(ros::console::Level, const char* text, const char*, const char*, int) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    text_ += text;
    text_ += '\n';
  }
  bool holds(const std::string& words) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return text_.find(words) != std::string::npos;
  }

 private:
  mutable std::mutex mutex_;
  std::string text_;
};

/// Nodelets in this process, loaded by their plugin names, and a camera that a test plays.
class NodeletChain : public testing::Test {
 protected:
  NodeletChain() : loader_(false), spinner_(2) { spinner_.start(); }
  ~NodeletChain() override {
    for (const auto& name : loaded_) loader_.unload(name);
    for (const auto& name : loaded_) ros::param::del(name);
  }

  bool load(const std::string& name, const std::string& type) {
    const bool done = loader_.load(name, "leap_object_tracker/" + type, {}, {});
    if (done) loaded_.push_back(name);
    return done;
  }

  ros::NodeHandle nh_;

 private:
  nodelet::Loader loader_;
  ros::AsyncSpinner spinner_;
  std::vector<std::string> loaded_;
};

}  // namespace leap_object_tracker
