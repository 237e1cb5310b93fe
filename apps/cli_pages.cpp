#include "apps/cli_pages.hpp"

#include <iostream>
#include <memory>
#include <sstream>

#include "apps/commands.hpp"

namespace clamber {
namespace {

using Apps = std::vector<const CLI::App*>;

/// Listed ones, in the order in which they were added.
Apps commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* sub) { return !sub->get_group().empty(); });
}

/// Of a whole line, for troff.
std::string escaped(const std::string& line) {
  std::string text;
  for (const char c : line) {
    if (c == '\\')
      text += "\\e";
    else if (c == '-')
      text += "\\-";
    else
      text += c;
  }
  const bool request = !text.empty() && (text[0] == '.' || text[0] == '\'');
  return request ? "\\&" + text : text;
}

void put_lines(std::ostream& out, const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) out << escaped(line) << '\n';
}

void put_option(std::ostream& out, const CLI::Option& option) {
  if (option.get_group().empty()) return;
  const bool positional = option.get_positional();
  out << ".TP\n\\fB" << escaped(option.get_name(positional, true)) << "\\fR";
  if (!positional && option.get_items_expected_max() > 0)
    out << " \\fI" << escaped(option.get_type_name()) << "\\fR";
  out << '\n' << escaped(option.get_description());
  if (!option.get_default_str().empty()) out << " [" << escaped(option.get_default_str()) << ']';
  out << '\n';
}

void put_command(std::ostream& out, const CLI::App& app, const std::string& name) {
  out << ".SS \"" << name << "\"\n";
  put_lines(out, app.get_description() + '.');
  for (const CLI::Option* option : app.get_options())
    if (option->get_name(false, true) != "-h,--help") put_option(out, *option);
  if (const std::string footer = app.get_footer(); !footer.empty()) {
    out << ".PP\n.nf\n";
    put_lines(out, footer);
    out << ".fi\n";
  }
  for (const CLI::App* sub : commands_of(app)) put_command(out, *sub, name + ' ' + sub->get_name());
}

void put_words(std::ostream& out, const CLI::App& app, const std::string& name) {
  std::string words;
  for (const CLI::App* sub : commands_of(app)) words += sub->get_name() + ' ';
  for (const CLI::Option* option : app.get_options())
    for (const std::string& word : option->get_lnames()) words += "--" + word + ' ';
  if (!words.empty()) words.pop_back();
  out << "    '" << name << "') words='" << words << "' ;;\n";
  for (const CLI::App* sub : commands_of(app)) put_words(out, *sub, name + ' ' + sub->get_name());
}

void put_names(std::ostream& out, const CLI::App& app, const std::string& name) {
  for (const CLI::App* sub : commands_of(app)) {
    out << " '" << name << ' ' << sub->get_name() << "'";
    put_names(out, *sub, name + ' ' + sub->get_name());
  }
}

}  // namespace

std::string man_page(const CLI::App& app) {
  std::ostringstream out;
  out << ".TH CLAMBER 1 \"\" \"clamber " CLAMBER_VERSION "\" \"User Commands\"\n"
      << ".SH NAME\nclamber \\- multi\\-contact climbing for humanoid robots\n"
      << ".SH SYNOPSIS\n.B clamber\n.I command\n[\\fIoptions\\fR]\n"
      << ".SH DESCRIPTION\n";
  put_lines(out, app.get_description());
  out << ".PP\n.nf\n";
  put_lines(out, app.get_footer());
  out << ".fi\n.SH COMMANDS\n";
  for (const CLI::App* command : commands_of(app))
    put_command(out, *command, "clamber " + command->get_name());
  return out.str();
}

std::string bash_completion(const CLI::App& app) {
  std::ostringstream out;
  std::ostringstream names;
  put_names(names, app, "clamber");
  out << "# bash completion for clamber, made by `clamber pages bash`\n"
      << "_clamber() {\n"
      << "  local current=${COMP_WORDS[COMP_CWORD]} path=clamber words='' i name\n"
      << "  local names=(" << names.str() << " )\n"
      << "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
      << "    for name in \"${names[@]}\"; do\n"
      << "      [[ \"$path ${COMP_WORDS[i]}\" != \"$name\" ]] || { path=$name; break; }\n"
      << "    done\n"
      << "  done\n"
      << "  case $path in\n";
  put_words(out, app, "clamber");
  out << "  esac\n"
      << "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
      << "}\n"
      << "complete -o bashdefault -o default -F _clamber clamber\n";
  return out.str();
}

void add_pages_command(CLI::App& app) {
  CLI::App* pages = app.add_subcommand("pages", "Manual page and shell completion")->group("");
  pages->require_subcommand(1);
  pages->add_subcommand("man", "man(7) source")->callback([&app] { std::cout << man_page(app); });
  pages->add_subcommand("bash", "completion")->callback([&app] {
    std::cout << bash_completion(app);
  });
}

}  // namespace clamber
