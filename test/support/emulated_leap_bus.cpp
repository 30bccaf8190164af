#include "emulated_leap_bus.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <umockdev-1.0/umockdev.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace leap_object_tracker {
namespace {

constexpr int kFirstAddress = 2, kLastAddress = 127;
constexpr char kPreload[] = "libumockdev-preload.so.0";

void prepend(const char* variable, const std::string& value, const char* separator) {
  const char* present = std::getenv(variable);
  const std::string text = present ? value + separator + present : value;
  setenv(variable, text.c_str(), 1);
}

}  // namespace

void restartWithUmockdev(char** arguments) {
  const char* preload = std::getenv("LD_PRELOAD");
  if (preload && std::strstr(preload, kPreload)) return;
  prepend("LD_PRELOAD", kPreload, ":");
  prepend("ASAN_OPTIONS", "verify_asan_link_order=0", ":");
  prepend("TSAN_OPTIONS", "ignore_noninstrumented_modules=1", ":");
  execv("/proc/self/exe", arguments);
  std::perror("starting again with libumockdev-preload");
  std::exit(1);
}

EmulatedBus::EmulatedBus() : testbed_(umockdev_testbed_new()) {
  gchar* root = umockdev_testbed_get_root_dir(testbed_);
  root_ = root;
  g_free(root);
  g_free(umockdev_testbed_add_device(testbed_, "usb", "usb1", nullptr, "busnum", "1", "devnum", "1",
                                     "speed", "480", "bConfigurationValue", "1", "idVendor", "1d6b",
                                     "idProduct", "0002", "bNumConfigurations", "1", nullptr,
                                     nullptr));
}

EmulatedBus::~EmulatedBus() {
  ports_.clear();
  EmulatedFiles::instance().allowAll();
  g_object_unref(testbed_);
}

EmulatedBus::Port& EmulatedBus::port(int number) {
  std::unique_ptr<Port>& port = ports_[number];
  if (!port) port = std::make_unique<Port>(*this, number);
  return *port;
}

EmulatedBus::Port::~Port() {
  if (occupied()) unplug();
}

void EmulatedBus::Port::plug(EmulatedLeap& leap, bool announce) {
  leap.powerOn();
  usbfs_ = std::make_shared<EmulatedUsbfs>(leap, [this](bool readable) { setReadable(readable); });
  usbfs_->setFastLink(!slow_);
  const int address = bus_.next_address_;
  bus_.next_address_ = address == kLastAddress ? kFirstAddress : address + 1;
  const std::string name = "1-" + std::to_string(number_);
  // Without DEVTYPE libusb does not look at the device yet.
  gchar* path = umockdev_testbed_add_device(
      bus_.testbed_, "usb", name.c_str(), "/sys/devices/usb1", "busnum", "1", "devnum",
      std::to_string(address).c_str(), "speed", slow_ ? "12" : "480", "bConfigurationValue", "1",
      "bNumConfigurations", "1", "idVendor", "f182", "idProduct", "0003", nullptr, nullptr);
  system_path_ = path;
  g_free(path);
  Bytes descriptors = EmulatedLeap::deviceDescriptor();
  const Bytes configuration = EmulatedLeap::configurationDescriptor();
  descriptors.insert(descriptors.end(), configuration.begin(), configuration.end());
  umockdev_testbed_set_attribute_binary(bus_.testbed_, system_path_.c_str(), "descriptors",
                                        descriptors.data(), static_cast<int>(descriptors.size()));

  char file[64];
  std::snprintf(file, sizeof file, "/dev/bus/usb/001/%03d", address);
  device_file_ = file;
  const std::string real_file = bus_.root_ + device_file_;
  g_mkdir_with_parents((bus_.root_ + "/dev/bus/usb/001").c_str(), 0755);
  if (mkfifo(real_file.c_str(), 0600) != 0) throw std::runtime_error("mkfifo " + real_file);
  {
    // A pipe of one page: with a byte in it there is no room, so poll() waits.
    const std::lock_guard<std::mutex> lock(fifo_mutex_);
    fifo_ = ::open(real_file.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    fcntl(fifo_, F_SETPIPE_SZ, 4096);
  }
  setReadable(false);
  EmulatedFiles::instance().add(fifo_, usbfs_);

  const std::pair<const char*, std::string> properties[] = {
      {"DEVTYPE", "usb_device"},
      {"DEVNAME", device_file_},
      {"BUSNUM", "001"},
      {"DEVNUM", device_file_.substr(device_file_.size() - 3)},
      {"PRODUCT", "f182/3/0"}};
  for (const auto& [key, value] : properties)
    umockdev_testbed_set_property(bus_.testbed_, system_path_.c_str(), key, value.c_str());
  occupied_ = true;
  if (announce) umockdev_testbed_uevent(bus_.testbed_, system_path_.c_str(), "add");
}

/// Requests end before the kernel tells of it.
void EmulatedBus::Port::unplug(bool announce) {
  usbfs_->unplug();
  if (announce) umockdev_testbed_uevent(bus_.testbed_, system_path_.c_str(), "remove");
  ::unlink((bus_.root_ + device_file_).c_str());
  umockdev_testbed_remove_device(bus_.testbed_, system_path_.c_str());
  const std::lock_guard<std::mutex> lock(fifo_mutex_);
  char byte;
  while (::read(fifo_, &byte, 1) == 1) {
  }
  syscall(SYS_close, std::exchange(fifo_, -1));  // not the program's own closing of the file
  occupied_ = false;
}

void EmulatedBus::Port::denyAccess() { EmulatedFiles::instance().deny(device_file_); }

void EmulatedBus::Port::setReadable(bool readable) {
  const std::lock_guard<std::mutex> lock(fifo_mutex_);
  if (fifo_ < 0) return;
  char byte = 0;
  while (::read(fifo_, &byte, 1) == 1) {
  }
  if (!readable && ::write(fifo_, &byte, 1) != 1) std::abort();
}

}  // namespace leap_object_tracker
