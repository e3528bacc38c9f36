// English texts of experiment/.

export const experiment = {
  title: "Experiment",
};
