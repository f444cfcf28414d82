# SPDX-License-Identifier: MIT
# Completions of stemvo for fish, from its own help.
function __stemvo_command
    for word in (commandline -opc)[2..-1]
        if not string match -q -- '-*' $word
            echo $word
            return
        end
    end
end
function __stemvo_complete
    set -l command (__stemvo_command)
    set -l words (commandline -opc)
    if string match -q -- '-*' (commandline -ct)
        stemvo $command --help 2>/dev/null | string match -rg '^  (?:-[a-z],)?(--[a-z-]+)'
    else if test -z "$command"
        stemvo --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p'
    else if test "$words[-1]" = --set
        stemvo --dump-config 2>/dev/null | awk '/^[a-z_]+:/ { group = $1; sub(":.*", "", group); if (NF > 1 && $2 !~ /^#/) print group "=" }
                                                /^  [a-z_0-9]+:/ { key = $1; sub(":.*", "", key); print group "." key "=" }'
    end
end
complete -c stemvo -a '(__stemvo_complete)'
