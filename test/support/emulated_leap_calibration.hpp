#pragma once

#include <cctype>
#include <cstdint>
#include <string>
#include <vector>

namespace leap_object_tracker {

using Bytes = std::vector<std::uint8_t>;

/// Bytes of hexadecimal text; blanks are ignored.
inline Bytes fromHex(const std::string& text) {
  Bytes bytes;
  std::string digits;
  for (const char c : text)
    if (std::isxdigit(static_cast<unsigned char>(c))) digits += c;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// Calibrations in the memory of two real units.
inline Bytes calibrationOfUnitA() {
  return fromHex(
      "434100885ecfc7511d0b2042363653bec1900443b052c9c045dbf0c0d58c1c39f9d5003be5d0a23facad983e97ff"
      "903c5a64bb3fe9b7af3e9eb5dbbb61c60043f2c6bcc03cb5adc025eb2fbb1526bdbb55df93b964b003438e434fc1"
      "e20848c05da6153a33cf1c3ae5d0a23facad983e97ff903c5a64bb3fe9b7af3e9eb5dbbb61c60043696e62c13cb5"
      "adc0917901bb438fe13aab3a8e3991e6791f");
}

inline Bytes calibrationOfUnitB() {
  return fromHex(
      "43410087506a4c51dd5a2042660c293dbbe70543279c0ebf3f9d89401588323ab1a25abbe5d0a23facad983e97ff"
      "903c5a64bb3fe9b7af3e9eb5dbbb585d034334212a4078df9c4065cbb6b9c6fe73bb6efa85bb3aee0543619a703f"
      "9a84ca40f6490e3adcac8cbbe5d0a23facad983e97ff903c5a64bb3fe9b7af3e9eb5dbbb585d034349028a4078df"
      "9c401ca8a5bba381cdba3098853b7b26629d");
}

/// Puts the right checksum at the end of a calibration.
inline Bytes withChecksum(Bytes calibration) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 4 < calibration.size(); ++i)
    sum += static_cast<std::uint32_t>(calibration[i]) << (8 * (i % 4));
  for (std::size_t i = 0; i < 4; ++i)
    calibration[calibration.size() - 4 + i] = static_cast<std::uint8_t>(sum >> (8 * i));
  return calibration;
}

}  // namespace leap_object_tracker
