"""Labels of every recipe's images compared with an independent ray cast of the exported mesh."""
