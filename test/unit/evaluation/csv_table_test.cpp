#include "leap_object_tracker/evaluation/csv_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

namespace leap_object_tracker {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsNan;

class CsvFile : public testing::Test {
 protected:
  ~CsvFile() override { std::remove(path_.c_str()); }
  const std::string path_ =
      testing::TempDir() + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
};

TEST_F(CsvFile, becomesColumnsWithHolesForWords) {
  std::ofstream(path_) << "stamp,state,total_ms\n1.5,tracking,2\n2.5,lost,\r\n";
  const CsvTable table = readCsv(path_);
  EXPECT_THAT(table.name, HasSubstr("becomesColumns"));
  EXPECT_THAT(table.column("stamp"), ElementsAre(1.5, 2.5));
  EXPECT_THAT(table.column("state"), ElementsAre(IsNan(), IsNan()));
  EXPECT_THAT(table.column("total_ms"), ElementsAre(2, IsNan()));
}

TEST_F(CsvFile, namesTheLineWithTooFewCells) {
  std::ofstream(path_) << "a,b\n1,2\n3\n";
  try {
    readCsv(path_);
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("line 3: 1 cells under 2 headings"));
  }
}

TEST_F(CsvFile, namesTheColumnsItHasWhenOneIsMissing) {
  std::ofstream(path_) << "a,b\n";
  try {
    readCsv(path_).column("stamp");
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no column 'stamp' (it has a, b)"));
  }
}

TEST_F(CsvFile, mustBeThereAndNotEmpty) {
  EXPECT_THROW(readCsv(path_), std::runtime_error);
  std::ofstream(path_) << "";
  EXPECT_THROW(readCsv(path_), std::runtime_error);
}

}  // namespace
}  // namespace leap_object_tracker
