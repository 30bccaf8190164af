#pragma once

#include <atomic>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <vector>

namespace leap_object_tracker {

/// Messages that keep their memory from one publication to the next. A message comes back by itself
/// when the last receiver lets go of it. To be used from one thread.
template <class Message>
class MessagePool {
 public:
  /// A message that nobody else holds; its old content is still there.
  boost::shared_ptr<Message> take() {
    for (const auto& message : messages_) {
      if (message.use_count() != 1) continue;
      // Pairs with the release of the last receiver: its reads end before our writes.
      std::atomic_thread_fence(std::memory_order_acquire);
      return message;
    }
    auto message = boost::make_shared<Message>();
    if (messages_.size() < kMost) messages_.push_back(message);
    return message;
  }

 private:
  static constexpr std::size_t kMost = 16;
  std::vector<boost::shared_ptr<Message>> messages_;
};

}  // namespace leap_object_tracker
