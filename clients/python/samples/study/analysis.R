# Reads the data of a study and summarises them by condition: analysis.py in R, without packages.
#
# `chefshat study export STUDY-ID --out data` writes the data; then `Rscript analysis.R data`. With `--whole-groups`, it leaves
# out groups of fewer, and those that somebody has left.
#
# The tables are read as `codebook.csv` describes them: codes become factors, empty cells missing values. A participant counts
# once in each condition: its games and items are averaged first. People who play together are not independent: then a group
# counts once, with the mean of its participants.

# The tables of an export, in a list by the names of their files without the ending, such as `games`.
read_export <- function(folder) {
  codebook <- read_cells(file.path(folder, "codebook.csv"))
  tables <- lapply(split(codebook, codebook$file), function(described) {
    cells <- read_cells(file.path(folder, described$file[1]))
    for (row in seq_len(nrow(described))) {
      column <- described$column[row]
      cells[[column]] <- typed(cells[[column]], described$type[row], described$codes[row])
    }
    cells
  })
  names(tables) <- sub("\\.csv$", "", names(tables))
  tables
}

# The cells of a table, all as text.
read_cells <- function(path) {
  read.csv(path, colClasses = "character", na.strings = "", check.names = FALSE, encoding = "UTF-8")
}

# The cells of a column, with the type that the codebook gives it. Times since 1970 are too large for integers of R.
typed <- function(cells, type, codes) {
  switch(type,
    integer = as.numeric(cells),
    boolean = cells == "true",
    code = {
      codes <- sub(" = .*", "", strsplit(codes, "; ", fixed = TRUE)[[1]])
      # A code that a spreadsheet would read as a formula begins with an apostrophe in cells, as the first may in the codebook.
      factor(sub("^'", "", cells), levels = sub("^'", "", codes))
    },
    cells
  )
}

# The measures of games, as rows of participant, condition, measure and value; not where a substitute played for it.
of_games <- function(tables) {
  games <- tables$games
  games <- games[games$outcome %in% "finished" & !games$practice & games$substituted %in% FALSE, ]
  measures <- list(
    place = games$place,
    points = games$points,
    hints = games$hints,
    seconds_per_decision = games$decision_time_us / games$timed_decisions / 1e6,
    timeouts_per_decision = games$timeouts / games$decisions
  )
  rows <- function(measure) {
    list(
      number = games$number, condition = games$condition,
      measure = rep(measure, nrow(games)), value = measures[[measure]]
    )
  }
  do.call(rbind, lapply(names(measures), function(measure) as.data.frame(rows(measure))))
}

# The scales of questionnaires, or the items that belong to none, as rows of participant, condition, measure and value.
of_answers <- function(tables) {
  answers <- tables$answers
  items <- tables$items
  is_measure <- items$kind %in% c("likert", "semantic_differential", "slider", "number") & is.na(items$attention_check)
  numbers <- paste(items$questionnaire, items$item)[is_measure]
  answers <- answers[answers$status %in% "answered" & paste(answers$questionnaire, answers$item) %in% numbers, ]
  scale <- ifelse(is.na(answers$scale), answers$item, answers$scale)
  data.frame(
    number = answers$number,
    condition = answers$condition,
    measure = paste(answers$questionnaire, scale),
    value = as.numeric(answers$answer)
  )
}

# The tables with the games and answers of these groups alone.
only_groups <- function(tables, kept) {
  for (name in c("games", "answers")) {
    tables[[name]] <- tables[[name]][tables[[name]]$group %in% kept, ]
  }
  tables
}

# Summarises each measure by condition: number of participants or groups, mean and standard deviation over them. NULL without
# any value.
summarise <- function(tables) {
  values <- rbind(of_games(tables), of_answers(tables))
  values <- values[!is.na(values$condition) & !is.na(values$value), ]
  if (nrow(values) == 0) {
    return(NULL)
  }
  counted <- "participants"
  units <- aggregate(value ~ measure + condition + number, values, mean)
  if (!is.null(tables$groups)) {
    counted <- "groups"
    units$group <- tables$participants$group[match(units$number, tables$participants$number)]
    units <- aggregate(value ~ measure + condition + group, units, mean)
  }
  figures <- aggregate(value ~ measure + condition, units, function(value) c(length(value), mean(value), sd(value)))
  # By the codes of characters, so that the order is the same in every language.
  figures <- figures[order(figures$measure, figures$condition, method = "radix"), ]
  columns <- c("measure", "condition", counted, "mean", "sd")
  setNames(data.frame(figures$measure, figures$condition, figures$value), columns)
}

# Prints a table with each column aligned to the right.
print_table <- function(figures) {
  is_mean <- names(figures) %in% c("mean", "sd")
  figures[is_mean] <- lapply(figures[is_mean], sprintf, fmt = "%.3f")
  columns <- Map(function(name, cells) format(c(name, as.character(cells)), justify = "right"), names(figures), figures)
  writeLines(do.call(paste, unname(columns)))
}

main <- function(arguments) {
  folder <- arguments[arguments != "--whole-groups"]
  if (length(folder) != 1 || startsWith(folder, "-")) {
    stop("usage: Rscript analysis.R FOLDER [--whole-groups], with what `chefshat study export` has written", call. = FALSE)
  }
  tables <- read_export(folder)
  states <- table(tables$participants$state)
  states <- states[order(-states)]
  states <- states[states > 0]
  cat("participants: ", paste(states, names(states), collapse = ", "), "\n", sep = "")
  if (!is.null(tables$groups)) {
    groups <- tables$groups
    whole <- groups[groups$completed == groups$participants & groups$participants == max(groups$participants), ]
    cat("groups: ", nrow(groups), ", of which ", nrow(whole), " are whole\n", sep = "")
    if ("--whole-groups" %in% arguments) {
      tables <- only_groups(tables, whole$group)
    }
  }
  figures <- summarise(tables)
  if (is.null(figures)) {
    cat("no finished games and no answers yet\n")
  } else {
    print_table(figures)
  }
}

# Not when another script sources this file for its functions.
if (sys.nframe() == 0) {
  main(commandArgs(trailingOnly = TRUE))
}
