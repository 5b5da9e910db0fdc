"""Scripts for shells that complete words: a plain table of commands and options in, bash, zsh or fish out."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

__all__ = ["SHELLS", "CompletedCommand", "CompletedOption"]


@dataclass(frozen=True)
class CompletedOption:
    """An option: how it is called, what it is, whether a value follows, what values there are, and whether files are."""

    names: tuple[str, ...]
    help: str
    takes_value: bool
    values: tuple[str, ...] = ()
    files: bool = False


@dataclass(frozen=True)
class CompletedCommand:
    """A command: the words that lead to it, what it is, its options, and what its arguments may be: words, files or both."""

    path: tuple[str, ...]
    help: str
    options: tuple[CompletedOption, ...]
    words: tuple[str, ...] = ()
    files: bool = False


def _below(commands: Sequence[CompletedCommand], path: tuple[str, ...]) -> list[CompletedCommand]:
    return [one for one in commands if one.path[:-1] == path and one.path]


def _cases(commands: Sequence[CompletedCommand], indent: str) -> str:
    """The `case` that follows the words of the line down to a command, in bash and zsh."""
    lines = [
        f"{indent}{shlex.quote(' '.join(one.path[:-1]) + ':' + one.path[-1])}) at={shlex.quote(' '.join(one.path))} ;;"
        for one in commands
        if one.path
    ]
    return "\n".join(lines)


def _with_values(commands: Sequence[CompletedCommand]) -> Iterator[tuple[str, CompletedOption]]:
    """Options that a value follows, each with the pattern of a `case` on the command and the option's names, in bash and zsh."""
    for one in commands:
        for option in one.options:
            if option.takes_value:
                yield "|".join(shlex.quote(f"{' '.join(one.path)}:{name}") for name in option.names), option


def bash(commands: Sequence[CompletedCommand]) -> str:
    """The script for bash.

    Parameters
    ----------
    commands : sequence of CompletedCommand
        The program itself, with an empty path, and all commands.
    """
    values, arguments = [], []
    for patterns, option in _with_values(commands):
        given = f"words={shlex.quote(' '.join(option.values))}" if option.values else ""
        files = "files=1" if option.files else ""
        values.append(f"    {patterns}) {'; '.join(filter(None, (given, files))) or ':'} ;;")
    for one in commands:
        at = " ".join(one.path)
        names = " ".join(name for option in one.options for name in option.names)
        words = " ".join([*(child.path[-1] for child in _below(commands, one.path)), *one.words])
        files = " files=1;" if one.files else ""
        arguments.append(f"    {shlex.quote(at)}) options={shlex.quote(names)}; words={shlex.quote(words)};{files} ;;")
    newline = "\n"
    return f"""# completion of hmc in bash: eval "$(hmc completion bash)"
_hmc() {{
  local current="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" at="" options="" words="" files="" word
  [[ $current == "=" ]] && current=""
  [[ $before == "=" ]] && before="${{COMP_WORDS[COMP_CWORD-2]}}"
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case "$at:$word" in
{_cases(commands, "      ")}
    esac
  done
  case "$at:$before" in
{newline.join(values)}
    *) case "$at" in
{newline.join("  " + line for line in arguments)}
      esac
      if [[ $current == -* ]]; then words="$options"; files=""; fi ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  if [[ -n $files ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t -O "${{#COMPREPLY[@]}}" COMPREPLY < <(compgen -f -- "$current")
  fi
}}
complete -F _hmc hmc
"""


def _described(pairs: Sequence[tuple[str, str]]) -> str:
    """Words with what they are, as zsh's `_describe` reads them."""
    return " ".join(shlex.quote(word.replace(":", r"\:") + (":" + help if help else "")) for word, help in pairs)


def zsh(commands: Sequence[CompletedCommand]) -> str:
    """The script for zsh; `commands` as for `bash`."""
    values, arguments = [], []
    for patterns, option in _with_values(commands):
        files = "files=1;" if option.files else ""
        values.append(f"    {patterns}) found=({_described([(word, '') for word in option.values])}); {files} ;;")
    for one in commands:
        at = " ".join(one.path)
        options = _described([(name, option.help) for option in one.options for name in option.names])
        words = _described([*((child.path[-1], child.help) for child in _below(commands, one.path)), *((word, "") for word in one.words)])
        files = " files=1;" if one.files else ""
        arguments.append(f"      {shlex.quote(at)}) if [[ $current == -* ]]; then found=({options}); else found=({words});{files} fi ;;")
    newline = "\n"
    return f"""#compdef hmc
# completion of hmc in zsh: put this file, called _hmc, into a folder of $fpath
_hmc() {{
  local current="${{words[CURRENT]}}" before="${{words[CURRENT-1]}}" at="" files="" word
  local -a found
  for word in "${{(@)words[2,CURRENT-1]}}"; do
    case "$at:$word" in
{_cases(commands, "      ")}
    esac
  done
  case "$at:$before" in
{newline.join(values)}
    *) case "$at" in
{newline.join(arguments)}
    esac ;;
  esac
  (( $#found )) && _describe hmc found
  [[ -n $files ]] && _files
  return 0
}}
if [[ ${{funcstack[1]}} == _hmc ]]; then _hmc "$@"; else compdef _hmc hmc; fi
"""


def _fish_quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def fish(commands: Sequence[CompletedCommand]) -> str:
    """The script for fish; `commands` as for `bash`."""
    lines = ["# completion of hmc in fish: hmc completion fish > ~/.config/fish/completions/hmc.fish", "complete -c hmc -f"]
    for one in commands:
        below = _below(commands, one.path)
        seen = [f"__fish_seen_subcommand_from {word}" for word in one.path]
        none_below = [f"not __fish_seen_subcommand_from {' '.join(child.path[-1] for child in below)}"] if below else []
        here = _fish_quoted("; and ".join([*seen, *none_below]))
        start = f"complete -c hmc -n {here}"
        lines += [f"{start} -a {_fish_quoted(child.path[-1])} -d {_fish_quoted(child.help)}" for child in below]
        if one.words:
            lines.append(f"{start} -a {_fish_quoted(' '.join(one.words))}")
        if one.files:
            lines.append(f"{start} -F")
        for option in one.options:
            named = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names)
            value = f" -r{'' if option.files else 'f'}" if option.takes_value else ""
            value += " -F" if option.files else ""
            if option.values:  # a line of their own, as the description would be told of each value too; of two lines the last describes
                lines.append(f"{start} {named}{value} -a {_fish_quoted(' '.join(option.values))}")
            lines.append(f"{start} {named}{value} -d {_fish_quoted(option.help)}")
    return "\n".join(lines) + "\n"


#: Shells, and the writer of each one's script.
SHELLS: dict[str, Callable[[Sequence[CompletedCommand]], str]] = {"bash": bash, "zsh": zsh, "fish": fish}
