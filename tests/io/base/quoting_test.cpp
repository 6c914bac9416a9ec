// io/base/quoting.h: what a shell and a reader of CSV give back is the text that went in.
#include "io/base/quoting.h"

#include "io/process/process.h"
#include "tests/support/files/temp_dir.h"

namespace {

TEST(Quoting, TheShellReadsTheSameWords) {
  EXPECT_EQ(io::ShellWord("--size=1.5,2"), "--size=1.5,2");
  EXPECT_EQ(io::ShellWord(""), "''");
  EXPECT_EQ(io::ShellWord("it's"), "'it'\\''s'");
  for (const std::string word : {"a b", "it's", "''", "$HOME `ls` \\ \"x\"", "*?[", "a\nb", "ünï", "~"}) {
    const TempDir dir;
    const io::ProcessReport report =
        io::RunProcess({"/bin/sh", "-c", "printf %s " + io::ShellWord(word)}, {.log_path = dir / "out"});
    EXPECT_TRUE(report.Ok()) << word;
    EXPECT_EQ(ReadText(dir / "out"), word);
  }
}

TEST(Quoting, NothingInANameReachesTheTerminalAsAnOrder) {
  for (const std::string text : {"", "plain name.jpg", "two\nlines", "ünï \u2014 \U0001f4f7", "back\\slash"})
    EXPECT_EQ(io::Printable(text), text);
  EXPECT_EQ(io::Printable("a\x1b[31mred\x07"), "a\\x1b[31mred\\x07");
  EXPECT_EQ(io::Printable("over\rwritten\t\x7f"), "over\\x0dwritten\\x09\\x7f");
  EXPECT_EQ(io::Printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(io::Printable("\xc2\x9b"), "\\xc2\\x9b");       // CSI of the C1 set
  EXPECT_EQ(io::Printable("caf\xe9.jpg"), "caf\\xe9.jpg");  // Latin-1
  EXPECT_EQ(io::Printable("\xc3"), "\\xc3");
  EXPECT_EQ(io::Printable("\xc0\x9b"), "\\xc0\\x9b");                    // overlong
  EXPECT_EQ(io::Printable("\xe0\x80\x9b"), "\\xe0\\x80\\x9b");           // overlong
  EXPECT_EQ(io::Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");           // surrogate
  EXPECT_EQ(io::Printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // beyond U+10FFFF
}

TEST(Quoting, FieldsOfCsvAreQuotedWhereNeeded) {
  for (const std::string field : {"", "a", "b c", "it's"}) EXPECT_EQ(io::CsvField(field), field);
  EXPECT_EQ(io::CsvField("1,5"), "\"1,5\"");
  EXPECT_EQ(io::CsvField("say \"so\""), "\"say \"\"so\"\"\"");
  EXPECT_EQ(io::CsvField("two\nlines"), "\"two\nlines\"");
  EXPECT_EQ(io::CsvField("a\rb"), "\"a\rb\"");
  EXPECT_EQ(io::CsvQuoted("a"), "\"a\"");
}

}  // namespace
