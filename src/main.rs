use std::env;
use std::io;
use std::process;

use gimbald::cli::{Cli, Command};
use gimbald::commands;
use gimbald::daemon::logging;

fn main() -> process::ExitCode {
    let cli = match Cli::read(env::args_os()) {
        Ok(cli) => cli,
        Err(code) => return code.into(),
    };
    let _logging = logging::start(&cli.log);
    match cli.command {
        Command::Check(arguments) => commands::check::check(&arguments, &mut io::stdout(), &mut io::stderr()),
        Command::Run(arguments) => commands::run::run(&arguments, &mut io::stderr()),
        Command::Demo(arguments) => commands::demo::demo(&arguments, &mut io::stdout(), &mut io::stderr()),
        Command::Sim(command) => commands::sim::sim(&command, &mut io::stderr()),
        Command::Status(arguments) => commands::status::status(&arguments, &mut io::stderr()),
        Command::Gimbal(arguments) => commands::gimbal::gimbal(&arguments, &mut io::stdout(), &mut io::stderr()),
        Command::Scan(arguments) => commands::scan::scan(&arguments, &mut io::stdout(), &mut io::stderr()),
    }
    .into()
}
