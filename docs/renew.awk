# Renews the tables and blocks of a page that belong to one part: see docs/renew.
# Variables: part, its name; output, the file with what the part printed.

function trim(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }

# The chosen columns of a row of a table.
function chosen(row, columns,    cells, numbers, count, i, line) {
    if (columns == "") return row
    split(row, cells, "|")
    count = split(columns, numbers, " ")
    line = "|"
    for (i = 1; i <= count; i++) line = line cells[numbers[i] + 1] "|"
    return line
}

# Prints the table after the title. "A > B" is the first title B after the first title A.
function table(title, columns, rows,    row, number, titles, count, found) {
    count = title == "" ? 0 : split(title, titles, " > ")
    while ((getline row < output) > 0) {
        if (found < count) {
            if (index(row, titles[found + 1])) found++
            continue
        }
        if (row ~ /^\|/) {
            number++
            # The first two rows are the head.
            if (number < 3 || rows == "" || row ~ rows) print chosen(row, columns)
        } else if (number > 0) break
    }
    close(output)
    if (!number || (rows != "" && number < 3)) { print "docs/renew: " output " has no table after: " title > "/dev/stderr"; failed = 1 }
}

# Prints the lines from the title to the next empty line.
function block(title,    row, found) {
    while ((getline row < output) > 0) {
        if (index(row, title)) found = 1
        if (found && row == "") break
        if (found) print row
    }
    close(output)
    if (!found) { print "docs/renew: " output " has no line with: " title > "/dev/stderr"; failed = 1 }
}

/^<!-- renew: / {
    print
    count = split(substr($0, 12, length($0) - 15), fields, "|")
    if (trim(fields[1]) != part) next
    title = trim(fields[2]); columns = ""; rows = ""
    for (i = 3; i <= count; i++) {
        field = trim(fields[i])
        if (field ~ /^columns /) columns = substr(field, 9)
        if (field ~ /^rows /) {
            # A bar separates the fields of the comment, so `or` stands for it; `\.` for a bar of the table.
            rows = substr(field, 6)
            gsub(/ or /, "|", rows)
            gsub(/\\\. /, "[|] ", rows)
        }
    }
    pending = 1
    next
}
pending && /^\|/ { if (pending == 1) table(title, columns, rows); pending = 2; next }
pending == 1 && /^```/ { print; block(title); pending = 3; next }
pending == 3 { if (/^```/) { print; pending = 0 } next }
pending == 2 { pending = 0 }
{ print }
END { exit failed }
