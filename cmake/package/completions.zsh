#compdef stemvo
# SPDX-License-Identifier: MIT
# Completions of stemvo for zsh, from its own help.
local command='' word
for word in ${words[2,CURRENT-1]}; do
  [[ $word == -* ]] || { command=$word; break; }
done
if [[ ${words[CURRENT]} == -* ]]; then
  local -a options
  options=(${(f)"$(stemvo $command --help 2>/dev/null | grep -oE '^  (-[a-z],)?--[a-z-]+' | grep -oE -- '--[a-z-]+')"})
  compadd -- $options
elif [[ -z $command ]]; then
  local -a commands
  commands=(${(f)"$(stemvo --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p')"})
  compadd -- $commands
elif [[ ${words[CURRENT-1]} == --set ]]; then
  local -a keys
  keys=(${(f)"$(stemvo --dump-config 2>/dev/null | awk '/^[a-z_]+:/ { group = $1; sub(":.*", "", group); if (NF > 1 && $2 !~ /^#/) print group "=" }
                                                        /^  [a-z_0-9]+:/ { key = $1; sub(":.*", "", key); print group "." key "=" }')"})
  compadd -S '' -- $keys
else
  _files
fi
