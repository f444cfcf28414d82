# SPDX-License-Identifier: MIT
# Completions of stemvo for bash, from its own help.
_stemvo() {
  local word=${COMP_WORDS[COMP_CWORD]} command= i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    [[ ${COMP_WORDS[i]} == -* ]] || { command=${COMP_WORDS[i]}; break; }
  done
  COMPREPLY=()
  if [[ $word == -* ]]; then
    local options
    options=$(stemvo ${command:+"$command"} --help 2>/dev/null | grep -oE '^  (-[a-z],)?--[a-z-]+' | grep -oE -- '--[a-z-]+')
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word")
  elif [[ -z $command ]]; then
    local commands
    commands=$(stemvo --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$word")
  elif [[ ${COMP_WORDS[COMP_CWORD - 1]} == --set ]]; then
    compopt -o nospace 2>/dev/null
    local keys
    keys=$(stemvo --dump-config 2>/dev/null | awk '/^[a-z_]+:/ { group = $1; sub(":.*", "", group); if (NF > 1 && $2 !~ /^#/) print group "=" }
                                                   /^  [a-z_0-9]+:/ { key = $1; sub(":.*", "", key); print group "." key "=" }')
    mapfile -t COMPREPLY < <(compgen -W "$keys" -- "$word")
  fi
}
complete -o default -F _stemvo stemvo
