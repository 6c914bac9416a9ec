// Names in the order in which people count.
#include "io/base/natural_order.h"

#include <gtest/gtest.h>

namespace {

TEST(NaturalOrder, NumbersCompareByValue) {
  EXPECT_TRUE(io::NaturalLess("img2.jpg", "img10.jpg"));
  EXPECT_FALSE(io::NaturalLess("img10.jpg", "img2.jpg"));
  EXPECT_TRUE(io::NaturalLess("a1b2", "a01b3"));
  EXPECT_TRUE(io::NaturalLess("a", "ab"));
  EXPECT_FALSE(io::NaturalLess("x", "x"));
  EXPECT_NE(io::NaturalLess("1", "01"), io::NaturalLess("01", "1"));
}

}  // namespace
