// English texts of tournaments/.

export const tournaments = {
  title: "Tournaments",
};
